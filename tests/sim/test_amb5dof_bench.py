"""The AMB stand through the whole path: driver, bytes, simulated controller, Modbus drive. No threads, virtual time."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np
import pytest

from bench.cli.safety import making_safe
from bench.errors import BenchError, DeviceFault, InterlockError, StateNotReached
from bench.link.session import Session
from bench.recording import Recording
from bench.recording.recorder import Recorder, RunHeader
from bench.rigfile import capture, load_rig
from bench.run.job import WatchedClock
from bench.run.supervisor import Supervisor
from drivers.controller import Controller
from drivers.fieldbus import Fieldbus
from drivers.open_devices import open_devices
from sim_backend.devices.registers import Followed, RegisterBank
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

RIG = load_rig("amb5dof")
RADIAL = ("yi", "zi", "yo", "zo")
PID, CCS, CAC = range(3)


class Stand:
    """A simulated stand and the driver of its controller. `frames` digests everything that comes in."""

    def __init__(self, seed: int, **truth: float) -> None:
        self.machine = SimulatedRig(RIG, draw(RIG, seed, truth), 1)
        self.plant = self.machine.device.plant
        self.bank = RegisterBank(RIG, self.machine.truth, self.plant)
        self.supervisor = Supervisor()
        time = Followed(self.machine, self.bank)
        self.base = WatchedClock(time, self.machine.link.renew_lease, self.supervisor.check)
        self.controller = Controller(RIG, self.machine.link, self.base, Session(1, 1_767_225_600, "test"))
        self.frames, receive = hashlib.sha256(), self.machine.link.receive

        def heard() -> np.ndarray:
            batch = receive()
            self.frames.update(batch.tobytes())
            return batch

        self.machine.link.receive = heard  # type: ignore[method-assign]
        self.controller.connect()

    def levitate(self, law: int = PID) -> None:
        self.controller.enable()
        self.controller.set("law", law)
        self.controller.levitate()

    def reading(self, *channels: str) -> np.ndarray:
        return np.array([self.controller.reading(name) for name in channels])


@contextmanager
def driven(stand: Stand) -> Iterator[Fieldbus]:
    clock = stand.controller.clock
    with open_devices(RIG, stand.bank.port, clock, stand.controller.envelope) as bus:
        assert bus.drive is not None
        bus.drive.may_run = stand.controller.require_levitated
        stand.controller.companions.append(bus.pump)
        yield bus


def session(seed: int) -> Stand:
    """Levitate by the PID, spin by the drive, coast, land, switch off."""
    stand = Stand(seed)
    controller = stand.controller
    stand.levitate()
    assert controller.mode == "LEVITATED"
    with driven(stand) as bus:
        drive, speed = bus.drive, 2400 * math.pi / 30
        assert drive is not None
        assert bus.supply is not None
        drive.reach(speed)
        controller.clock.sleep(0.2)
        assert controller.mode == "SPINNING"
        assert controller.rotation.speed_rad_s == pytest.approx(speed, rel=0.01)
        assert drive.speed_rad_s == pytest.approx(speed, rel=0.01)
        assert bus.supply.voltage_V == 48.0
        pulses = stand.reading("pulses")[0]
        controller.clock.sleep(1.0)
        assert stand.reading("pulses")[0] - pulses == pytest.approx(40, abs=1)
        drive.coast()
        with pytest.raises(BenchError, match="refuses LAND: WRONG_STATE"):
            controller.land()  # it turns
        for _ in range(60):
            if controller.mode == "LEVITATED":
                break
            controller.clock.sleep(0.5)
        assert controller.rotation.speed_rad_s < controller.rotation.landing_speed
        controller.land()
        assert controller.mode == "READY"
        controller.disable()
    assert controller.mode == "OFF"
    assert controller.fault == "NONE"
    return stand


def test_levitate_spin_coast_and_land_and_the_same_seed_says_the_same_bytes() -> None:
    one, same = session(2), session(2)
    assert one.frames.digest() == same.frames.digest()
    rest = one.reading(*(f"pos_{axis}" for axis in RADIAL))
    assert rest == pytest.approx([-71e-6] * 4, abs=8e-6)  # on the rings, 45 degrees to both axes


@pytest.mark.parametrize("law", [PID, CCS, CAC])
def test_each_law_carries_the_weight_at_the_set_point(law: int) -> None:
    """T (2.6): at the centre and in the magnetic offsets; the upper coils alone with CAC, a bias of 1 A else."""
    stand = Stand(1)
    stand.levitate(law)
    stand.controller.set("ref_y", 20e-6)
    stand.controller.clock.sleep(4.0)
    y, z = stand.reading("pos_yi", "pos_yo"), stand.reading("pos_zi", "pos_zo")
    assert y == pytest.approx([20e-6] * 2, abs=3e-6)
    assert z == pytest.approx([0] * 2, abs=3e-6)
    upper, lower = (stand.reading(*(f"i_{axis}_{side}" for axis in RADIAL)) for side in "pn")
    if law == CAC:
        assert np.abs(lower).max() < 0.02
        assert upper.min() > 0.5
    else:
        assert upper + lower == pytest.approx([2.0] * 4, abs=0.05)
    assert abs(stand.reading("pos_x")[0]) < 2e-6


def test_the_controller_cannot_turn_the_rotor() -> None:
    """It has no motor: SPIN is refused, STOP has nothing to do; a lone rotor is turned by nobody."""
    stand = Stand(1)
    stand.levitate()
    assert "speed_ref" not in RIG.parameters
    with pytest.raises(BenchError, match="refuses SPIN: WRONG_STATE"):
        stand.controller._orders.command("SPIN")
    stand.controller.rotation.stop()
    with pytest.raises(InterlockError, match=r"capabilities\.angle"):
        stand.controller.rotation.spin(10.0)
    assert stand.controller.mode == "LEVITATED"


def test_without_a_host_the_drive_lets_go_and_the_rotor_coasts_and_lands() -> None:
    stand = Stand(1)
    stand.levitate()
    with driven(stand) as bus:
        assert bus.drive is not None
        bus.drive.reach(100.0)
        stand.machine.link.close()
        seen = []
        for _ in range(40):
            stand.machine.sleep(0.5)
            stand.bank.tick(stand.machine.now_ns())
            seen.append(stand.machine.device.state)
    assert list(dict.fromkeys(seen)) == ["COASTING", "LANDING", "FAULT"]
    assert stand.machine.device.fault == "HEARTBEAT_LOST"
    assert stand.bank.drives["drive"].fault == "COMMUNICATION"
    assert stand.plant.shaft_speed < stand.controller.rotation.landing_speed


def test_a_capture_at_speed(tmp_path: Path) -> None:
    """Full-rate readings from a turning shaft, from a pulse on; the upload runs while it turns."""
    stand, speed = Stand(1), 6000 * math.pi / 30
    stand.levitate()
    controller = stand.controller
    role, header = controller.capture, RunHeader({"run": {}}, {})
    assert role is not None
    streams = [controller.telemetry.layout]
    with (
        driven(stand) as bus,
        Recorder(tmp_path / "r.mcap", clock=controller.clock, streams=streams, header=header, plain=True) as recorder,
    ):
        assert bus.drive is not None
        controller.recorder = recorder
        role.arm(("pos_yi", "speed"), seconds=0.1, before_s=0.05, trigger=capture.at_speed(300.0))
        bus.drive.reach(speed)
        role.wait(1.0)
        role.upload(on="the way")
        role.arm(
            ("pos_yi", "pos_zi", "pulses", "pulse_age", "angle"), seconds=0.5, before_s=0.02, trigger=capture.PULSE
        )
        role.wait(2.0)
        role.upload(on="speed")
        assert controller.mode == "SPINNING"
        bus.drive.coast()
    recording = Recording.open(tmp_path / "r.mcap")
    (way,), (level,) = recording.captures(on="the way"), recording.captures(on="speed")
    rising = way.arrays("speed")["speed"]
    assert rising[499] < 300 <= rising[500]
    x = level.arrays()
    assert x["pulses"][200] == x["pulses"][199] + 1
    assert 0 <= x["pulse_age"][200] < 1e-4
    seen = np.flatnonzero(np.diff(x["pulses"])) + 1
    at = x["t_s"][seen] - x["pulse_age"][seen]  # to better than a tick
    turn_s = np.diff(at).mean()
    assert 2 * math.pi / turn_s == pytest.approx(speed, rel=2e-3)
    assert np.diff(at) == pytest.approx(turn_s, rel=1e-3)
    whole = slice(seen[0], seen[-1])
    phase = 2 * math.pi * (x["t_s"] - at[0])[whole] / turn_s
    vector = 2 * np.mean(x["pos_yi"][whole] * np.exp(-1j * phase))
    assert 5e-6 < abs(vector) < 50e-6
    left = x["pos_yi"][whole] - (vector * np.exp(1j * phase)).real
    assert np.std(left) < 0.5 * abs(vector)


def test_make_safe_lands_what_the_controller_sees_turning_for_a_while_yet() -> None:
    """The drive says standstill; the pulses, and with them the controller's state, say so half a second later."""
    stand = Stand(1)
    stand.levitate()
    with driven(stand) as bus:
        assert bus.drive is not None
        bus.drive.reach(100.0)
        at_once, slow, land = making_safe(stand.controller, stand.base, bus.drive)[0][:3]
        begin = stand.machine.now_ns()
        at_once.action()
        assert stand.controller.mode == "SPINNING"
        slow.action()
        land.action()
        assert (stand.machine.now_ns() - begin) * 1e-9 < 5.0
        assert bus.drive.confirm_off()
    assert stand.controller.mode == "READY"


@pytest.mark.long
def test_make_safe_does_not_let_down_a_shaft_whose_pulses_have_ended() -> None:
    """The drive is switched off, the rotor stays up, and a person is told."""
    stand = Stand(1, pulse_last=60.0)
    stand.levitate()
    with driven(stand) as bus:
        assert bus.drive is not None
        bus.drive.set_speed(300.0)
        bus.drive.run()
        with pytest.raises(DeviceFault, match="SENSOR"):
            stand.controller.clock.sleep(4.0)
        stand.controller.guarded = False
        found = stand.supervisor.make_safe(
            making_safe(stand.controller, stand.base, bus.drive)[0], stand.machine.now_ns
        )
        assert bus.drive.confirm_off()
    assert "the rotor is up" in found[-1].text
    assert stand.controller.mode == "COASTING"


def test_a_sensor_of_the_wrong_sign_is_never_levitated() -> None:
    stand = Stand(1, position_sign_yi=-1.0)
    with pytest.raises((StateNotReached, DeviceFault)):
        stand.levitate()


def test_twelve_volts_and_a_lost_pulse_show() -> None:
    stand = Stand(1, supply_V=12.0, pulse_missing=2.0)
    stand.levitate()
    assert stand.reading("supply")[0] == 12.0
    with driven(stand) as bus:
        assert bus.drive is not None
        bus.drive.set_speed(300.0)
        bus.drive.run()
        stand.controller.clock.sleep(4.0)
        assert stand.plant.shaft_speed == pytest.approx(300, rel=0.02)
        assert stand.reading("speed")[0] == pytest.approx(150, rel=0.02)  # one pulse in two turns
        bus.drive.coast()


@pytest.mark.parametrize("volts", [12.0, 48.0])
def test_twelve_volts_lose_the_run_up_that_forty_eight_hold(volts: float) -> None:
    """T Fig. 2.9 with the stand-ins that it needs: CAC, coils of 20 mH, 25 um of eccentricity."""
    half = 0.98 * 25e-6 / 2
    stand = Stand(1, supply_V=volts, inductance=20e-3, unbalance_i=half, unbalance_o=half, unbalance_phase_i=0.5,
                  unbalance_phase_o=0.5 + math.pi / 3)  # fmt: skip
    stand.levitate(CAC)
    with driven(stand) as bus:
        assert bus.drive is not None
        bus.drive.set_speed(6000 * math.pi / 30)
        bus.drive.run()
        lost = pytest.raises(DeviceFault, match="LEVITATION_LOST") if volts == 12 else nullcontext()
        with lost:
            stand.controller.clock.sleep(5.0)
        bus.drive.coast()


def test_the_envelope_watches_this_rigs_positions() -> None:
    """Pressed into the ring by a set point far outside it: the controller trips by itself, or the envelope does."""
    stand = Stand(1)
    stand.levitate(CCS)
    stand.controller.set("slew", 0.0)
    stand.controller.set("ref_y", 9e-5)
    stand.controller.set("ref_z", 9e-5)
    with pytest.raises((InterlockError, DeviceFault), match=r"pos_|LEVITATION_LOST"):
        stand.controller.clock.sleep(2.0)
