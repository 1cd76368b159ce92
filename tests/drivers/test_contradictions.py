"""States, speeds and readings that contradict each other, faults during make-safe, and conditions that no longer hold when a
request is repeated: each is told by its name, and nothing goes out that is safe at rest alone."""

from __future__ import annotations

import contextlib
import logging
from pathlib import Path

import pytest
from hostile_controller import TSBS, Bench, Telemetry, unchanged

from bench.cli import opening
from bench.errors import (
    BenchError,
    InterlockError,
    NoReply,
    ReadingsStand,
    Refused,
    RotorNotArrived,
    SpeedContradicts,
    StateContradicts,
)
from bench.link.frames import FrameBatch
from bench.recording.recorder import Recorder, RunHeader
from bench.run.machine_phase import cause_of
from sim_backend.core import DriveLaw

CODES = {name: float(code) for code, name in TSBS.choices("state").items()}
FAST_RAD_S = 40.0


def says(state: str) -> Telemetry:
    """Telemetry that goes on, and says that state."""
    return Telemetry(TSBS, {"state": CODES[state]}, frozen=(), stuck=False)


def watched(bench: Bench) -> list[tuple[str, float]]:
    """Each command that goes out from now on, and how fast the shaft turns then."""
    sent: list[tuple[str, float]] = []
    send = bench.link.send

    def look(batch: FrameBatch) -> None:
        before = len(bench.link.commands)
        send(batch)
        sent.extend((name, abs(bench.machine.device.plant.shaft_speed)) for name in bench.link.commands[before:])

    bench.link.send = look  # type: ignore[method-assign]
    return sent


@pytest.mark.parametrize("state", ["OFF", "READY"])
@pytest.mark.parametrize("speed", [FAST_RAD_S, 0.0])
def test_a_state_of_rest_is_not_believed_while_the_rotor_was_not_asked_to_land(state: str, speed: float) -> None:
    """STOP brakes a turning one first, MAKE_SAFE lands it, and the answers tell when it is down."""
    bench = Bench()
    if speed:
        bench.controller.rotation.spin(speed)
    sent = watched(bench)
    found, took_s = bench.made_safe(says(state), 0.05)
    assert [name for name, _ in sent if name != "IDENTIFY"] == [*(["STOP"] if speed else []), "MAKE_SAFE"]
    assert bench.state == "OFF"
    assert [f.code for f in found] == ["state-contradicts"]
    assert f"the controller says {state}, but it held the rotor and nobody asked it to land" in found[0].text
    assert ("speed 4" in found[0].text and "angle 4" in found[0].text) == bool(speed)
    assert took_s < 10.0


def test_amplifiers_are_not_switched_off_at_speed_though_the_rotor_was_asked_to_land() -> None:
    """LAND was sent, something drives the shaft up again, and telemetry says READY."""
    bench = Bench()
    bench.controller.rotation.spin(FAST_RAD_S)
    bench.controller.watch.condition.commanded("LAND")
    sent = watched(bench)
    found, _ = bench.made_safe(says("READY"), 0.05)
    assert [speed for name, speed in sent if name in ("LAND", "DISABLE") and speed > 5.0] == []
    assert [f.code for f in found] == ["state-contradicts"]
    assert bench.state == "OFF"


@pytest.mark.parametrize("state", ["OFF", "READY"])
def test_a_run_ends_at_once_when_its_controller_says_that_a_held_rotor_rests(state: str) -> None:
    bench = Bench()
    bench.controller.rotation.spin(FAST_RAD_S)
    bench.link.change = says(state)
    begin = bench.machine.now_ns()
    with pytest.raises(
        StateContradicts, match=f"says {state} since .* nobody asked it to land; its speed channel says"
    ):
        bench.controller.clock.sleep(5.0)
    assert bench.machine.now_ns() - begin < 0.5e9


def test_nobody_reaches_into_a_machine_whose_angle_turns_though_its_speed_says_nothing() -> None:
    bench = Bench()
    bench.controller.rotation.spin(FAST_RAD_S)
    bench.link.change = Telemetry(TSBS, {"state": CODES["READY"], "speed": 0.0}, frozen=(), stuck=False)
    with contextlib.suppress(StateContradicts):
        bench.controller.clock.sleep(0.1)
    assert (bench.controller.mode, bench.controller.rotation.speed_rad_s) == ("READY", 0.0)
    with pytest.raises(InterlockError, match=r"nobody may touch the shaft in state READY at 4\d"):
        bench.controller.require_landed()


def test_a_landing_that_was_refused_is_no_leave_to_rest() -> None:
    bench = Bench()
    bench.controller.rotation.spin(FAST_RAD_S)
    with pytest.raises(Refused):
        bench.controller.command("LAND")
    bench.link.change = says("READY")
    with pytest.raises(StateContradicts):
        bench.controller.clock.sleep(5.0)


def test_a_rotor_that_was_asked_to_land_may_rest() -> None:
    bench = Bench()
    for _ in range(2):
        bench.controller.land()
        bench.controller.clock.sleep(0.5)
        bench.controller.levitate()
    bench.controller.land()
    bench.controller.disable()
    bench.controller.clock.sleep(0.5)
    found, _ = bench.made_safe(unchanged)
    assert (found, bench.said) == ((), [])


@pytest.mark.parametrize("fault", ["LEVITATION_LOST", "OVERSPEED"])
def test_a_fault_while_the_machine_is_made_safe_is_told(fault: str) -> None:
    """Levitation that is lost at speed takes the brake away too; the run was stopped by something else."""
    bench = Bench()
    bench.controller.rotation.spin(FAST_RAD_S)
    begun: list[int] = []

    def trip(batch: FrameBatch) -> FrameBatch:
        if "STOP" in bench.link.commands:
            begun.append(bench.machine.now_ns())
        if begun and begun[-1] - begun[0] > 300_000_000 and bench.machine.device.fault == "NONE":
            bench.machine.device.states.fail(fault)
        return batch

    bench.link.change = trip
    found, took_s = bench.made_safe(trip, 0.1)
    assert found[0].code == "controller-fault"
    assert f"while the machine was made safe, the controller reports {fault}" in found[0].text
    dropped = [f.text for f in found if f.code == "make-safe-failed"]
    assert len(dropped) == (fault == "LEVITATION_LOST")
    assert all(
        "switched its amplifiers off by itself (LEVITATION_LOST) while the shaft turned at 3" in t for t in dropped
    )
    assert took_s < 20.0


def test_telemetry_that_still_says_levitated_beside_answers_that_say_off() -> None:
    bench = Bench()
    found, _ = bench.made_safe(says("LEVITATED"), 0.05)
    assert bench.state == "OFF"
    assert found[-1].code == "state-contradicts"
    text = next(f.text for f in found if "the controller's watchdog" in f.text)
    assert "telemetry says LEVITATED, a speed of 0.0 rad/s; the last answer said OFF" in text
    assert "does not take it to be slow" not in text


@pytest.mark.parametrize("way", ["make safe", "run"])
def test_land_is_not_repeated_once_the_shaft_turns(way: str) -> None:
    """LAND's reply is lost, and something drives the shaft: the repeat would come at speed."""
    bench = Bench()
    sent = watched(bench)
    plain, deaf = unchanged, Telemetry(TSBS, {}, frozen=(), stuck=False, lost=("CommandReply",))

    def lose(batch: FrameBatch) -> FrameBatch:
        if "LAND" not in bench.link.commands:
            return plain(batch)
        bench.machine.device.plant.drive(DriveLaw(2.0, 50.0, 210.0), 60.0)
        return deaf(batch)

    bench.machine.device.states.obey = lambda name: name == "IDENTIFY"  # type: ignore[method-assign] # accepted, not executed
    if way == "run":
        bench.link.change = lose
        bench.controller.guarded = False
        with pytest.raises(NoReply, match="was not sent again, as the machine is no longer seen fit for it"):
            bench.controller.land()
    else:
        bench.made_safe(lose)
    assert len([name for name, _ in sent if name == "LAND"]) == 1
    assert bench.machine.device.plant.shaft_speed > 5.0


def test_a_bench_that_ends_lets_the_next_one_in(tmp_path: Path) -> None:
    """The recording is closed by then: nothing of the last words goes into it."""
    bench = Bench()
    c = bench.controller
    with Recorder(
        tmp_path / "x.mcap", clock=c.clock, streams=[c.telemetry.layout], header=RunHeader({}, {})
    ) as recorder:
        c.recorder = recorder
        c.clock.sleep(0.2)
        c.land()
        c.disable()
    opening._released(c)
    assert bench.said[-1] == "RELEASE"


def test_a_doubted_state_keeps_nobody_out_but_a_held_shaft_does() -> None:
    """Telemetry stuck at LEVITATED beside answers that say OFF: the next bench may in. One that does levitate is not let go."""
    doubted, held = Bench(), Bench()
    doubted.made_safe(says("LEVITATED"), 0.05)
    opening._released(doubted.controller)
    assert doubted.said[-1] == "RELEASE"
    opening._released(held.controller)
    assert "RELEASE" not in held.said


def test_a_speed_that_stands_at_zero_while_the_angle_turns_is_named() -> None:
    bench = Bench()
    bench.link.change = Telemetry(TSBS, {"speed": 0.0}, frozen=(), stuck=False)
    begin = bench.machine.now_ns()
    with pytest.raises(SpeedContradicts, match=r"the speed channel says 0\.0 rad/s, and the angle turns at [3-6]\d"):
        bench.controller.rotation.spin(60.0)
    assert bench.machine.now_ns() - begin < 10e9


def test_a_rotor_that_does_not_come_nearer_is_told_and_not_waited_for_long(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench()
    bench.machine.device.states.obey = lambda name: True  # type: ignore[method-assign] # SPIN is accepted, not executed
    begin = bench.machine.now_ns()
    with caplog.at_level(logging.INFO, "drivers"), pytest.raises(RotorNotArrived, match="came no nearer for 20 s"):
        bench.controller.rotation.spin(60.0)
    assert bench.machine.now_ns() - begin < 25e9
    lines = [r.getMessage() for r in caplog.records if hasattr(r, "shown")]
    assert lines[0] == "waiting 5 s for 60 rad/s; the rotor turns at 0.0 rad/s; no nearer for 5 s, 15 s left"
    assert len(lines) == 3


def test_readings_that_all_stand_end_a_run() -> None:
    bench = Bench()
    bench.link.change = Telemetry(TSBS, {}, frozen=())
    begin = bench.machine.now_ns()
    with pytest.raises(ReadingsStand) as caught:
        bench.controller.rotation.spin(60.0)
    assert bench.machine.now_ns() - begin < 2e9
    assert cause_of(caught.value)[1].code == "stuck-channel"


@pytest.mark.parametrize(
    ("error", "code"), [(StateContradicts, "state-contradicts"), (SpeedContradicts, "speed-and-angle-disagree")]
)
def test_each_has_its_finding(error: type[BenchError], code: str) -> None:
    assert cause_of(error("x"))[1].code == code
