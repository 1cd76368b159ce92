"""The rig rlsrm as it is drawn: tolerances, planted defects, who works on it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rlsrm_host import RIG, Host

from sim_backend.machines.rlsrm.defects import DEFECTS, NAMES
from sim_backend.machines.rlsrm.machine import DAILY, RLSRM, stated
from sim_backend.machines.rlsrm.params import DEG, PlantParams
from sim_backend.truth import draw, nominal

G = 9.7877
AIR = (1 - 1.2 / 8000) / (1 - 1.2 / 7950) * (1 - 1.18 / 7950)


def test_the_rig_of_the_middle_is_the_machine_of_the_explanation() -> None:
    """What is stated without a half of its own: the core's defaults but for what a laboratory adds."""
    plant = draw(RIG, 0, nominal(RIG)).plant.plant
    added = {"once": 0.05 * DEG, "lock_give": (1e-7, 5e-3), "gravity": G, "ambient": 30.0}
    assert plant == replace(PlantParams(), **added)


def test_every_number_is_drawn_within_what_is_stated() -> None:
    """And each once for each phase where there are six."""
    numbers = stated(RIG)
    drawn = [draw(RIG, seed) for seed in range(60)]
    for name, t in numbers.items():
        values = np.array([truth.values[name] for truth in drawn])
        if t.half_width:
            assert abs(values - t.value).max() <= t.half_width
            assert np.ptp(values) > 1.5 * t.half_width
    gains = np.array([truth.plant.plant.map.gain for truth in drawn])
    assert abs(np.corrcoef(gains.T) - np.eye(6)).max() < 0.5
    changed = [k for k in PlantParams.__dataclass_fields__ if len({getattr(t.plant.plant, k) for t in drawn}) == 60]
    assert {*changed} >= {
        "map", "mass", "inertia", "viscous", "coulomb", "coulomb_sides", "bearing_radius", "tilt", "stop", "resistance",
        "ambient", "thermal_resistance", "thermal_capacity", "supply", "current_gain", "current_offset", "edge", "scale",
        "once", "once_phase", "lock_give",
    }  # fmt: skip


def test_another_day_has_other_weather_and_the_same_machine() -> None:
    one, other = (draw(RIG, 5, visit=visit) for visit in (0, 1))
    assert {name for name in one.values if one.values[name] != other.values[name]} == {*DAILY}


def test_defects_are_harmless_unless_they_are_planted() -> None:
    truth = draw(RIG, 3)
    assert RLSRM.params(truth.values, DEFECTS) == truth.plant
    told = {
        "drop_fraction",
        "dead_after_s",
        "fault_after_s",
        "drive_fault_after_s",
        "hanger_off_at_zero",
        "integrator_factor",
    }
    elsewhere = ("factor_", "mass_error", "hook_", "lever_", "reference_", "cell_")
    for name, harmless in DEFECTS.items():
        if name not in told and not name.startswith(elsewhere):
            planted = RLSRM.params(truth.values, {**DEFECTS, name: 2.0 if harmless else 1.0})
            assert planted != truth.plant, name


@pytest.mark.parametrize("seed", range(1, 13))
def test_drawn_machines_are_homed_and_held_over_their_protocol(seed: int) -> None:
    """What is read when held is true but for counts, the encoder's own error and the linear one's scale."""
    host = Host(seed)
    host.hold()
    host.go(3, x=-9e-3, angle=1.0)
    assert (host.device.state, host.device.fault) == ("HOLDING", "NONE")
    x, angle, *_ = host.core.place
    assert host.telemetry["x"][-1] == pytest.approx(x, abs=1.1e-6)
    off = (host.telemetry["angle"][-1] - angle + math.pi) % (2 * math.pi) - math.pi
    assert abs(off) < 0.24 * DEG
    assert abs(host.telemetry["x"][-1] + 9e-3) < 60e-6


def pulled(host: Host) -> tuple[float, float]:
    """What hangs, N and N m, once it was let go."""
    host.run(0.4)
    return tuple(host.core.hanging)  # type: ignore[return-value]


def test_weights_pull_along_and_around() -> None:
    """By hand: M3 of 0.4 kg and its cord of 0.5 g give 3.92 N; on the disc, without a cord, 97.9 mN m."""
    host = Host()
    assert host.operator.request("hang far M3") == "ok 0.3"
    assert pulled(host) == pytest.approx((0.4005 * G * AIR, 0), rel=1e-6)
    assert host.operator.request("hang near M1") == "ok 0.3"
    assert pulled(host) == pytest.approx((0.25 * G * AIR, 0), rel=1e-6)
    assert host.operator.request("hang far -") == "ok 0.3"
    assert pulled(host)[0] == pytest.approx(-0.1505 * G * AIR, rel=1e-6)
    assert host.operator.request("hang near -") == "ok 0.3"
    assert host.operator.request("lever left M3") == "ok 0.3"
    assert pulled(host) == pytest.approx((0, 0.4 * G * AIR * 0.025), rel=1e-6, abs=1e-9)
    assert host.operator.request("lever left -") == "ok 0.3"
    assert host.operator.request("lever right M3") == "ok 0.3"
    assert pulled(host)[1] == pytest.approx(-0.4 * G * AIR * 0.025, rel=1e-6)
    for line in ("hang middle M1", "hang far M9", "lever up M1", "mount hat", "turn 3"):
        assert host.operator.request(line).startswith("error")


def test_a_weight_moves_the_axis_to_its_end_and_its_mass_with_it() -> None:
    """3.9 N on 5400 N/m without integrators: 0.45 mm at most, less what friction holds back."""
    host = Host()
    host.hold()
    assert host.set(ki_x=0.0, ki_angle=0.0) == "OK"
    host.go(2, x=0.0, angle=1.0)
    before = host.core.place[0]
    host.operator.request("hang far M3")
    host.run(2)
    pull = 0.4005 * G * AIR
    low, high = (pull - 3.2) / 5400, pull / 5400
    assert low < host.core.place[0] - before < high
    assert host.core.moving == pytest.approx((3.35 + 0.4005, 1.5e-3))
    host.operator.request("lever right M2")
    assert host.core.moving == pytest.approx((3.35 + 0.4005, 1.5e-3 + 0.25 * 0.025**2))


def test_a_ring_or_a_bar_can_be_put_on() -> None:
    host = Host()
    host.operator.request("mount ring")
    assert host.core.moving == pytest.approx((3.35 + 0.75, 1.5e-3 + 1.2e-3))
    host.operator.request("mount bar")
    assert host.core.moving == pytest.approx((5.35, 1.6e-3))
    host.operator.request("mount -")
    assert host.core.moving == pytest.approx((3.35, 1.5e-3))


def test_a_pulley_rubs() -> None:
    """Its friction holds either way: what the axis needs to be moved grows by it."""
    host = Host(**{"hooks.far.pulley.friction": 0.02})
    host.operator.request("hang far M4")
    assert host.core.rubbing[0] == pytest.approx(0.02 * 0.6005 * G * AIR, rel=1e-6)
    host.operator.request("hang far -")
    assert host.core.rubbing == (0, 0)


@pytest.mark.parametrize(("defect", "line", "sign"), [("hook_exchanged", "hang far M2", (-1, 0)),
                                                     ("lever_exchanged", "lever left M2", (0, -1))])  # fmt: skip
def test_loads_on_the_wrong_side(defect: str, line: str, sign: tuple[int, int]) -> None:
    host = Host(**{defect: 1.0})
    host.operator.request(line)
    assert tuple(np.sign(pulled(host))) == sign


def test_exchanged_phases_are_told_by_their_amplifiers() -> None:
    """Amplifier b of stator 1 drives winding c: what it tells is its own current, the winding's torque is that of c."""
    host = Host(exchange_phases=1.0, rest_angle=10 * DEG)
    host.command("ENABLE")
    host.operator.request("mount lock")
    assert host.set(open_phase=1, open_current=2.0) == "OK"
    host.run(0.2)
    assert host.telemetry["i_b1"][-1] == pytest.approx(2, abs=0.01)
    assert host.core.currents[2] == pytest.approx(2, abs=0.01)
    assert host.core.acting[1] > 0  # C, aligned at 30 degrees


def test_defects_of_sensors() -> None:
    """What is told of a current by a sensor connected the other way round; temperatures of the start; a gain in the loop."""
    host = Host(told_factor_a2=-1.0, cold_told=1.0, current_factor_b2=0.9)
    host.command("ENABLE")
    host.operator.request("mount lock")
    assert host.set(open_phase=3, open_current=3.0) == "OK"
    host.run(2)
    assert host.telemetry["i_a2"][-1] == pytest.approx(-3, abs=0.01)
    assert host.telemetry["temp_2"][-1] == pytest.approx(303.15, abs=0.01)
    assert host.core.warmth[3] > 32
    assert host.set(open_phase=4) == "OK"
    host.run(0.2)
    assert host.telemetry["i_b2"][-1] == pytest.approx(3, abs=0.01)
    assert host.core.currents[4] == pytest.approx(3 / 0.9, abs=0.01)


def test_a_planted_fault_takes_the_currents_off() -> None:
    host = Host(fault_after_s=1.0)
    host.command("ENABLE")
    host.run(1.2)
    assert (host.device.state, host.device.fault) == ("FAULT", "SENSOR")
    assert RIG.messages["Telemetry"].signal("fault").choices[int(host.telemetry["fault"][-1])] == "SENSOR"


def test_names_of_phases_are_those_of_the_rig_file() -> None:
    assert RIG.capabilities.phase_test is not None
    assert tuple(name.lower() for name in RIG.capabilities.phase_test.phases) == NAMES


def test_a_shaft_whose_far_end_is_high_slides_to_the_near_one() -> None:
    """1 mrad of 3.35 kg: 33 mN towards -x, or 0.5 g t^2 of it where nothing rubs."""
    host = Host(coulomb=0.0, viscous_x=0.0, **{"shaft.tilt": 1e-3})
    begin, tick = host.core.place[0], host.core.tick
    host.run(0.4)
    since, before = host.core.tick * 5e-5, tick * 5e-5
    assert host.core.place[0] - begin == pytest.approx(-0.5e-3 * G * (since**2 - before**2), rel=1e-6)
