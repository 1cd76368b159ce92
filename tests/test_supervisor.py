"""Stopping: signals in each part of a run, and make-safe against steps that fail or hang."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Iterator

import pytest

from bench.clock import PumpedClock
from bench.errors import LinkError, SignalAbort
from bench.findings import Effect
from bench.run.supervisor import SafeStep, Supervisor


class StillClock:
    """Bench time that only sleeping advances."""

    def __init__(self) -> None:
        self.t_ns = 0

    def now_ns(self) -> int:
        return self.t_ns

    def sleep(self, seconds: float) -> None:
        self.t_ns += round(seconds * 1e9)


@pytest.fixture
def supervisor() -> Iterator[Supervisor]:
    with Supervisor().watching() as watching:
        yield watching


def test_a_signal_ends_a_sleep_within_a_slice(supervisor: Supervisor) -> None:
    base = StillClock()

    def pump() -> None:
        if base.t_ns == 1_000_000_000:
            os.kill(os.getpid(), signal.SIGTERM)
        supervisor.check(base.t_ns)

    with pytest.raises(SignalAbort, match="SIGTERM"), supervisor.moving():
        PumpedClock(base, pump).sleep(60.0)
    assert base.t_ns <= 1_100_000_000
    assert supervisor.stopped_by == "SIGTERM"


def test_a_signal_between_two_checks_raises_at_the_next_one(supervisor: Supervisor) -> None:
    sent = []

    def command() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        sent.append("whole")
        supervisor.check(0)
        sent.append("not reached")

    with pytest.raises(SignalAbort), supervisor.moving():
        command()
    assert sent == ["whole"]


def test_a_signal_after_the_last_check_still_stops_the_run(supervisor: Supervisor) -> None:
    with pytest.raises(SignalAbort), supervisor.moving():
        os.kill(os.getpid(), signal.SIGINT)


def test_a_signal_while_nothing_moves_raises_at_once(supervisor: Supervisor) -> None:
    with pytest.raises(SignalAbort, match="SIGINT"):
        os.kill(os.getpid(), signal.SIGINT)


def test_handlers_are_restored() -> None:
    before = (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM))
    with Supervisor().watching():
        assert signal.getsignal(signal.SIGTERM) != before[1]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_handlers_are_restored_after_an_exception() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(ZeroDivisionError), Supervisor().watching():
        _ = 1 / 0
    assert signal.getsignal(signal.SIGTERM) == before


def test_a_signal_inherited_as_ignored_stops_the_run() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with pytest.raises(SignalAbort), Supervisor().watching():
            os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_terminal_that_closes_stops_the_run(supervisor: Supervisor) -> None:
    with pytest.raises(SignalAbort, match="SIGHUP"), supervisor.moving():
        os.kill(os.getpid(), signal.SIGHUP)
    assert supervisor.stopped_by == "SIGHUP"


def test_a_hangup_ignored_at_the_start_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Supervisor().watching() as watching, watching.moving():
            os.kill(os.getpid(), signal.SIGHUP)
        assert watching.stopped_by is None
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_make_safe_does_every_step_in_order_although_some_fail(supervisor: Supervisor) -> None:
    done: list[str] = []

    def fail() -> None:
        done.append("stop")
        raise LinkError("link can0 is dead")

    steps = (
        SafeStep("stop", fail, 1.0),
        SafeStep("land", lambda: done.append("land"), 1.0),
        SafeStep("disable", lambda: done.append("disable"), 1.0),
    )
    findings = supervisor.make_safe(steps, lambda: 0)
    assert done == ["stop", "land", "disable"]
    assert [(f.code, f.where, f.effect) for f in findings] == [("make-safe-failed", "stop", Effect.ERROR)]
    assert "link can0 is dead" in findings[0].text


def test_a_step_that_does_not_end_is_cut_off_and_the_next_one_runs(supervisor: Supervisor) -> None:
    base = StillClock()
    clock = PumpedClock(base, lambda: supervisor.check(base.t_ns))
    done: list[str] = []
    steps = (SafeStep("land", lambda: clock.sleep(1e6), 2.0), SafeStep("disable", lambda: done.append("disable"), 1.0))
    findings = supervisor.make_safe(steps, base.now_ns)
    assert done == ["disable"]
    assert base.t_ns <= 2_100_000_000
    assert "did not end within its time" in findings[0].text


def test_each_step_has_its_own_time(supervisor: Supervisor) -> None:
    base = StillClock()
    clock = PumpedClock(base, lambda: supervisor.check(base.t_ns))
    steps = tuple(SafeStep(f"step {n}", lambda: clock.sleep(1.5), 2.0) for n in range(3))
    assert supervisor.make_safe(steps, base.now_ns) == ()
    assert base.t_ns == 4_500_000_000


def test_a_second_signal_during_make_safe_is_logged_and_ignored(
    supervisor: Supervisor, caplog: pytest.LogCaptureFixture
) -> None:
    base = StillClock()
    clock = PumpedClock(base, lambda: supervisor.check(base.t_ns))
    done: list[str] = []

    def land() -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        clock.sleep(1.0)
        done.append("landed")

    with pytest.raises(SignalAbort), supervisor.moving():
        os.kill(os.getpid(), signal.SIGINT)
    with caplog.at_level(logging.WARNING):
        assert supervisor.make_safe((SafeStep("land", land, 5.0),), base.now_ns) == ()
    assert done == ["landed"]
    assert "SIGTERM ignored" in caplog.text
    assert supervisor.stopped_by == "SIGINT"


def test_a_first_signal_during_make_safe_waits_until_the_machine_is_safe(supervisor: Supervisor) -> None:
    base = StillClock()
    clock = PumpedClock(base, lambda: supervisor.check(base.t_ns))
    done: list[str] = []

    def land() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        clock.sleep(1.0)
        done.append("landed")

    assert supervisor.make_safe((SafeStep("land", land, 5.0),), base.now_ns) == ()
    assert done == ["landed"]
    with pytest.raises(SignalAbort, match="SIGINT"):
        supervisor.checkpoint()
