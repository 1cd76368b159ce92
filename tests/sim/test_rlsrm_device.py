"""The simulated controller of the rotary-linear motor as a host has it: commands and states, set points, waves, phases that are
tested, captures."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rlsrm_host import RIG, Host

from sim_backend.machines.rlsrm.device import SETTABLE, control_of
from sim_backend.machines.rlsrm.params import DEG, ControlParams, PlantParams
from sim_backend.machines.rlsrm.plant import Plant, slopes

PULSE = ("i_a1", "u_a1", "i_b1")
FAULT_NAMES = RIG.messages["Telemetry"].signal("fault").choices


def test_every_parameter_is_a_control_of_the_machine() -> None:
    assert {*RIG.parameters} - {"watchdog_s"} == SETTABLE


def test_a_controller_is_what_its_parameters_make_it() -> None:
    """Those of the rig file make the core's own, but for the set points' rates."""
    made = control_of({name: p.default for name, p in RIG.parameters.items()})
    assert made == replace(ControlParams(), speed=(0.08, 6.0))
    other = control_of(
        {"kp_x": 1.0, "angle_rate": 2.0, "map_gain_6": 1.1, "map_zero_2": 0.01, "map_slope": 0.8, "rule": 1.0}
    )
    assert (other.kp[0], other.speed[1], other.rule) == (1.0, 2.0, 1.0)
    assert (other.map.gain[5], other.map.zero[1], other.map.slope) == (1.1, 0.01, 0.8)
    assert control_of({"current_zero_6": 0.02}).current_zero == (0.0,) * 5 + (0.02,)


def test_a_loop_takes_off_what_its_sensor_is_told_to_read_without_a_current() -> None:
    """A sensor that reads 20 mA too much makes 1.98 A of 2 A; with its zero told it makes 2 A, and the others what they made.
    None of it where no current is wanted."""
    plant = Plant(PlantParams(locked=(1.0, 1.0), current_offset=(0.02,) * 6))
    plant.switch(on=True)
    plant.zero(1, 0.02)
    plant.drive(np.array([2.0, 2.0, 0.0, 0.0, 0.0, 0.0]))
    plant.run(0.05, 0)
    assert plant.currents == pytest.approx([1.98, 2.0, 0.0, 0.0, 0.0, 0.0], abs=1e-4)


def test_commands_lead_from_state_to_state() -> None:
    host = Host(2)
    assert host.command("HOME") == "WRONG_STATE"
    assert host.command("ENABLE") == "OK"
    assert host.command("HOLD") == "WRONG_STATE"  # the zeros are not known
    host.run(0.04)
    assert host.telemetry["flags"][-1] == 16
    assert host.command("HOME") == "OK"
    host.run(12)
    assert host.states() == ["HOMING", "READY"]
    assert host.telemetry["flags"][-1] == 16 + 64
    assert host.command("HOLD") == "OK"
    assert [host.command(name) for name in ("HOLD", "HOME", "DISABLE", "RELEASE", "ENABLE")] == ["WRONG_STATE"] * 5
    host.go(4, x=5e-3, angle=2.0)
    assert host.states() == ["MOVING", "HOLDING"]
    assert host.telemetry["x"][-1] == pytest.approx(5e-3, abs=60e-6)
    assert host.telemetry["angle"][-1] == pytest.approx(2.0, abs=0.5 * DEG)
    assert [host.command("LET_GO"), host.device.state] == ["OK", "READY"]
    assert [host.command("HOLD"), host.device.state] == ["OK", "HOLDING"]  # zeros stay known
    assert [host.command("LET_GO"), host.command("DISABLE"), host.command("ENABLE")] == ["OK"] * 3
    assert [host.command("HOLD"), host.device.state] == ["OK", "HOLDING"]


def test_waves_go_about_where_it_was_sent() -> None:
    """A sine from the command MOVE on; STOP brakes it by the rise, and the axis is held where it came to rest."""
    host = Host()
    host.hold()
    host.go(2, x=3e-3, angle=1.0)
    assert host.set(x_wave=1, x_amplitude=2e-3, x_period=2.0) == "OK"
    assert host.command("MOVE") == "OK"
    host.run(4)
    ref, t = host.telemetry["x_ref"], host.telemetry["tick"] * 5e-5
    design = np.column_stack([np.ones_like(t), np.sin(math.pi * t), np.cos(math.pi * t)])
    mean, sine, cosine = np.linalg.lstsq(design, ref)[0]
    assert (mean, math.hypot(sine, cosine)) == pytest.approx((3e-3, 2e-3), abs=1e-6)
    assert max(abs(host.telemetry["x"] - ref)) < 0.6e-3
    assert set(host.states()) == {"MOVING"}
    assert host.command("STOP") == "OK"
    host.run(1)
    assert host.states()[-1] == "HOLDING"
    rise = np.diff(host.telemetry["x_ref"], 2) / 1e-6
    assert abs(rise).max() < 0.3 * 1.05
    assert host.command("MOVE") == "OK"
    host.run(2)
    assert abs(host.telemetry["x_ref"] - host.telemetry["x_ref"].mean()).max() == pytest.approx(2e-3, rel=0.02)


def test_a_square_is_sent() -> None:
    host = Host()
    host.hold()
    assert host.set(angle_wave=2, angle_amplitude=0.5, angle_period=2.0) == "OK"
    assert host.command("MOVE") == "OK"
    host.run(4)
    middle = host.telemetry["angle_ref"].mean()
    assert np.ptp(host.telemetry["angle_ref"]) == pytest.approx(1.0, abs=1e-3)
    assert abs(np.diff(host.telemetry["angle_ref"])).max() < 6e-3
    assert middle == pytest.approx(host.telemetry["angle_ref"][0], abs=0.6)


def test_make_safe_stops_it_and_takes_its_currents_off() -> None:
    host = Host()
    host.hold()
    assert host.set(angle_target=50.0) == "OK"
    host.run(1)
    assert host.telemetry["speed"][-1] == pytest.approx(6, abs=0.6)
    assert host.command("MAKE_SAFE") == "OK"
    host.run(1)
    assert host.states() == ["STOPPING", "READY", "OFF"]
    assert abs(host.telemetry["i_a1"][-1]) < 0.01
    assert abs(host.core.place[3]) < 0.01
    assert host.command("RELEASE") == "OK"


def test_what_is_made_safe_and_held_waits_for_nobody() -> None:
    host = Host()
    host.hold()
    assert host.command("LET_GO") == "OK"
    assert host.set(safe_holds=1) == "OK"
    assert host.command("HOLD") == "OK"
    assert host.command("MAKE_SAFE") == "OK"
    host.run(3, beating=False)
    assert (host.device.state, host.device.fault) == ("HOLDING", "NONE")
    assert host.command("IDENTIFY", session=0x22) == "OK"  # another host may take it over
    assert host.command("LET_GO", session=0x22) == "OK"
    host.run(1, beating=False)
    assert (host.device.state, host.device.fault) == ("FAULT", "HEARTBEAT_LOST")


@pytest.mark.parametrize("when", ["READY", "HOMING", "HOLDING", "MOVING"])
def test_a_host_that_falls_silent_is_missed(when: str) -> None:
    host = Host()
    if when in ("HOLDING", "MOVING"):
        host.hold()
    else:
        assert host.command("ENABLE") == "OK"
    if when == "HOMING":
        assert host.command("HOME") == "OK"
    if when == "MOVING":
        assert host.set(x_target=0.013) == "OK"
    assert host.device.state == when
    host.run(2, beating=False)
    assert host.states()[-1] == "FAULT"
    fault, age = host.telemetry["fault"], host.telemetry["host_age"]
    first = np.flatnonzero(fault)[0]
    assert 0.08 <= age[first] < 0.085
    assert FAULT_NAMES[int(fault[-1])] == host.device.fault == "HEARTBEAT_LOST"
    assert abs(host.core.place[2:]).max() < 1e-3
    host.run(0.1)
    assert host.command("CLEAR_FAULT") == "OK"
    assert host.device.state == "OFF"


def test_a_phase_carries_a_current_in_ready_alone() -> None:
    host = Host()
    assert host.command("ENABLE") == "OK"
    assert host.set(open_phase=1, open_current=2.0) == "OK"
    host.run(0.2)
    assert host.telemetry["i_b1"][-1] == pytest.approx(2, abs=0.01)
    assert abs(host.core.currents[[0, 2, 3, 4, 5]]).max() == 0
    assert host.set(open_phase=7) == "OK"
    host.run(0.1)
    assert host.core.currents.max() == 0
    assert host.set(open_phase=0) == "OK"
    assert host.command("DISABLE") == "OK"
    host.run(0.1)
    assert host.core.currents.max() == 0
    host.hold()
    assert host.set(open_phase=2) == "WRONG_STATE"


def test_a_phase_that_is_tested_loses_its_current_with_its_host() -> None:
    host = Host()
    assert host.command("ENABLE") == "OK"
    assert host.set(open_phase=1, open_current=2.0) == "OK"
    host.run(0.3, beating=False)
    assert (host.device.state, host.core.currents.max()) == ("FAULT", 0)


def test_a_pulse_tells_flux_and_resistance() -> None:
    """Locked where phase A1 is 10 degrees off: the flux is the integral of u - R i up to the current's limit, R that of the
    held end, and what came on goes off again."""
    host = Host(rest_angle=10 * DEG, rest_x=2e-3, lock_give_x=0.0, lock_give_angle=0.0)
    assert host.operator.request("mount lock") == "ok 1.0"
    assert host.command("ENABLE") == "OK"
    assert host.set(open_phase=0, open_current=0.0) == "OK"
    layout = host.arm(PULSE, 1200, "RISES", "u_a1", 20.0)
    assert host.set(pulse_s=0.03) == "OK"
    host.run(0.1)
    told = host.captured(layout)
    i, u = told["i_a1"], told["u_a1"]
    assert u[:40].max() < 1
    assert u[40:50].mean() == pytest.approx(90, abs=0.2)
    assert i[200:630].mean() == pytest.approx(6, abs=0.01)
    assert u[641] == pytest.approx(-90, abs=0.5)
    assert abs(i[-50:]).max() < 0.01
    ohm = u[400:630].mean() / i[400:630].mean()
    warm = host.core.warmth[0]
    assert ohm == pytest.approx(7.8 * (1 + 0.00393 * (warm - 20)), rel=2e-3)
    flux = np.concatenate([[0], np.cumsum(u[1:] - ohm * (i[1:] + i[:-1]) / 2) * 5e-5])
    g = slopes(host.device.truth.plant.plant.map, *host.core.place[:2])[0][0]
    assert flux[90:110].mean() == pytest.approx(1.5e-3 * 6 + g * 6 / math.sqrt(1 + (6 / 8.5) ** 2), rel=3e-3)
    assert abs(flux[-1]) < 3e-4
    assert host.core.place[1] == pytest.approx(10 * DEG, abs=1e-9)


def test_a_lock_gives_way_with_the_current() -> None:
    """As far as the torque asks, and comes back; along the other axis nothing."""
    host = Host(rest_angle=20 * DEG, lock_give_angle=5e-3, lock_give_x=0.0)
    assert host.operator.request("mount lock") == "ok 1.0"
    assert host.command("ENABLE") == "OK"
    assert host.set(open_phase=0, open_current=6.0) == "OK"
    host.run(0.2)
    torque = host.core.acting[1]
    assert torque < -0.1
    assert host.core.place[:2] == pytest.approx([0, 20 * DEG + 5e-3 * torque], abs=1e-9)
    assert host.set(open_current=0.0) == "OK"
    host.run(0.2)
    assert host.core.place[1] == pytest.approx(20 * DEG, abs=1e-12)
    assert host.operator.request("mount -") == "ok 1.0"
    assert host.set(open_current=4.0) == "OK"
    host.run(0.5)
    assert abs(host.core.place[1]) < 10 * DEG  # it turns in


def test_a_restart_forgets_zeros_and_parameters() -> None:
    """As after power-on: OFF, the mover rolls out without currents, and nothing is held before its zeros are found anew."""
    host = Host(faults=("reboot@12",))
    host.hold()
    assert host.set(x_rate=0.02, x_target=0.013) == "OK"
    while host.now < 13.3e9:
        host.run(0.1)
    host.run(0.6)
    assert (host.device.state, host.core.homed) == ("OFF", (False, False))
    assert host.device.parameters.values["x_rate"] == 0.08
    assert host.telemetry["tick"][-1] * 5e-5 < 1
    assert host.command("ENABLE") == "OK"
    assert host.command("HOLD") == "WRONG_STATE"


def test_a_heartbeat_whose_counter_stands_still_is_none() -> None:
    host = Host(faults=("stuck-heartbeat@10",))
    host.hold()
    assert host.set(x_wave=1, x_amplitude=2e-3) == "OK"
    assert host.command("MOVE") == "OK"
    while host.now < 11.5e9:
        host.run(0.1)
    host.run(1)
    assert (host.device.state, host.device.fault) == ("FAULT", "HEARTBEAT_LOST")


def test_a_sample_says_what_was_read_a_tick_before() -> None:
    """Beside a capture, whose ticks are the same: the reading of a sample stands there from the tick before it on."""
    host = Host()
    host.hold()
    assert host.set(x_wave=1, x_amplitude=5e-3, x_period=1.0) == "OK"
    assert host.command("MOVE") == "OK"
    layout = host.arm(("x", "force_asked"), 8000, "NOW", "x", 0.0, before=0)
    host.run(0.5)
    told = host.captured(layout)
    assert host.device.captures is not None
    at = host.telemetry["tick"].astype(int) - host.device.captures.memory.first_tick
    within = np.flatnonzero((at > 1) & (at < 8000))[1:]
    assert len(within) > 300
    assert told["x"][at[within] - 1] == pytest.approx(host.telemetry["x"][within], abs=1e-9)
    assert told["x"][at[within] - 2] == pytest.approx(host.telemetry["x"][within - 1], abs=1e-9)
    assert told["force_asked"][at[within] - 1] == pytest.approx(host.telemetry["force_asked"][within], abs=6e-4)
