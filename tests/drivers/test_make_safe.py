"""Make-safe against machines that cannot be seen, that lie, or that take their time: what is sent, when, and how it ends."""

from __future__ import annotations

import logging
import os
import signal

import pytest
from hostile_controller import AMB, TSBS, Bench, Telemetry, unchanged

from bench.cli.safety import END_S
from bench.link.frames import FrameBatch
from sim_backend.core import DriveLaw

FAST = {"speed": 1000.0}


def test_a_sound_machine_is_landed_and_switched_off_at_once() -> None:
    bench = Bench()
    found, took_s = bench.made_safe(unchanged)
    assert (found, bench.said, bench.state) == ((), ["LAND", "DISABLE"], "OFF")
    assert took_s < 2.0


def test_a_turning_rotor_is_braked_before_it_is_landed() -> None:
    bench = Bench()
    bench.controller.rotation.spin(40.0)
    found, _ = bench.made_safe(unchanged, 0.1)
    assert (found, bench.said, bench.state) == ((), ["STOP", "LAND", "DISABLE"], "OFF")


@pytest.mark.parametrize("frozen", [("seq", "tick"), ("tick",), ("seq",), ()], ids=str)
@pytest.mark.parametrize("state", ["LEVITATED", "SPINNING"])
def test_telemetry_that_stands_at_a_thousand_rad_s_never_lands(frozen: tuple[str, ...], state: str) -> None:
    """A device that obeys LAND at any speed would drop the rotor. Its replies tell when it has come down by itself."""
    bench = Bench(AMB)
    code = next(c for c, name in AMB.choices("state").items() if name == state)
    found, took_s = bench.made_safe(Telemetry(AMB, {**FAST, "state": code}, frozen))
    assert "LAND" not in bench.said
    assert bench.said[0] == "MAKE_SAFE"
    assert bench.state == "OFF"
    assert found == ()
    assert took_s < 6.0


@pytest.mark.parametrize("speed", [0.0, 1000.0])
def test_a_machine_of_which_nothing_tells_is_left_to_itself(speed: float) -> None:
    bench = Bench(AMB)
    leases = bench.link.leases
    found, took_s = bench.made_safe(Telemetry(AMB, {"speed": speed}, lost=("CommandReply",)))
    assert set(bench.said) == {"MAKE_SAFE"}  # and its repeats: no reply comes
    assert bench.link.leases - leases < 200  # of a lease in each slice of 50 ms of 30 s
    assert not bench.base.renewing
    assert "the machine cannot be seen" in found[-1].text
    assert took_s == pytest.approx(END_S, abs=1.0)
    assert bench.state in ("OFF", "FAULT")


def test_a_machine_that_is_seen_now_and_then_is_not_waited_for_without_end() -> None:
    """Bytes that dribble: replies are lost, and a piece of telemetry comes every ten seconds."""
    bench = Bench(AMB)
    up = next(code for code, name in AMB.choices("state").items() if name == "LEVITATED")
    deaf = Telemetry(AMB, {"state": up}, frozen=(), lost=("CommandReply",), stuck=False)

    def dribble(batch: FrameBatch) -> FrameBatch:
        shown = bench.machine.now_ns() % 10_000_000_000 < 500_000_000
        return deaf(batch) if shown else batch[:0]

    found, took_s = bench.made_safe(dribble)
    assert [f.code for f in found] == ["make-safe-failed"] * 2  # nothing answered, and it is left to itself
    assert took_s < 2 * END_S + 5.0  # it may be seen once more than when make-safe began


def test_readings_that_stand_at_rest_do_not_say_that_the_shaft_is_slow() -> None:
    """The tick runs on; everything else is that of a rotor that stood."""
    bench = Bench()
    still = Telemetry(TSBS, {"state": 3.0, "speed": 0.0}, frozen=())
    bench.controller.guarded = False
    bench.link.change = still
    bench.controller.clock.sleep(0.1)
    bench.link.change = unchanged
    bench.controller.rotation.spin(60.0)
    bench.made_safe(still)
    assert bench.said[0] == "MAKE_SAFE"
    assert "LAND" not in bench.said


def test_a_speed_that_stands_at_zero_while_the_angle_turns_is_not_believed() -> None:
    bench = Bench()
    bench.controller.rotation.spin(60.0)
    landed: list[float] = []
    send = bench.link.send

    def watched(batch: FrameBatch) -> None:
        before = len(bench.link.commands)
        send(batch)
        if "LAND" in bench.link.commands[before:]:
            landed.append(abs(bench.machine.device.plant.shaft_speed))

    bench.link.send = watched  # type: ignore[method-assign]
    bench.made_safe(Telemetry(TSBS, {"state": 3.0, "speed": 0.0}, frozen=(), stuck=False), 0.1)
    assert landed == [] or max(landed) < 5.0
    assert bench.said[0] == "STOP"


def test_a_state_without_a_name_is_left_to_the_controller_at_once() -> None:
    bench = Bench()
    found, took_s = bench.made_safe(Telemetry(TSBS, {"state": 42.0}, frozen=(), stuck=False))
    assert (found, bench.said, bench.state) == ((), ["MAKE_SAFE"], "OFF")
    assert took_s < 6.0


def test_telemetry_that_is_gone_while_replies_come() -> None:
    bench = Bench()
    found, took_s = bench.made_safe(Telemetry(TSBS, lost=("Telemetry",)))
    assert (found, bench.said, bench.state) == ((), ["MAKE_SAFE"], "OFF")
    assert took_s < 6.0


def test_a_shaft_that_becomes_slower_may_take_its_time() -> None:
    """Nothing brakes it but a fifth of the friction: its fall is progress for longer than any wait without."""
    bench = Bench(AMB, viscous=1e-7, coulomb=4e-4)
    plant = bench.machine.device.plant
    plant.drive(DriveLaw(0.01, 0.08, 210.0), 130.0)
    bench.controller.clock.sleep(2.0)
    plant.drive(None)
    assert plant.shaft_speed > 120
    found, took_s = bench.made_safe(unchanged, 0.1)
    assert (found, bench.state) == ((), "OFF")
    assert bench.said == ["STOP", "LAND", "DISABLE"]
    assert took_s > END_S


def test_it_says_what_it_waits_for_in_lines_of_a_terminal(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench(AMB)
    with caplog.at_level(logging.INFO, "bench"):
        bench.made_safe(Telemetry(AMB, FAST, lost=("CommandReply",)))
    lines = [r.getMessage() for r in caplog.records if hasattr(r, "shown")]
    assert 5 <= len(lines) <= 8
    assert lines[0].startswith("make safe: waiting 1 s for its watchdog (UNSEEN); ")
    assert all(len(line) < 80 and "\n" not in line and line.endswith(" s left") for line in lines)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_signal_during_it_is_answered_and_changes_no_step(
    number: signal.Signals, caplog: pytest.LogCaptureFixture
) -> None:
    bench = Bench(AMB)
    still = Telemetry(AMB, FAST, lost=("CommandReply",))
    answered: list[float] = []
    sent: list[int] = []

    class Heard(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if number.name in record.getMessage():
                answered.append((bench.machine.now_ns() - sent[-1]) * 1e-9)

    def interrupted(batch: FrameBatch) -> FrameBatch:
        if "MAKE_SAFE" in bench.link.commands and len(sent) < 2:
            sent.append(bench.machine.now_ns())
            os.kill(os.getpid(), number)
        return still(batch)

    heard = Heard()
    logging.getLogger("bench.run.supervisor").addHandler(heard)
    try:
        with bench.supervisor.watching():
            found, took_s = bench.made_safe(interrupted)
    finally:
        logging.getLogger("bench.run.supervisor").removeHandler(heard)
    assert len(answered) == 2
    assert max(answered) <= 0.2
    assert set(bench.said) == {"MAKE_SAFE"}  # and its repeats: no reply comes
    assert took_s == pytest.approx(END_S, abs=1.0)
    assert "the machine cannot be seen" in found[-1].text
