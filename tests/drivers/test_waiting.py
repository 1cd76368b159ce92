"""Waiting on a computer that stands still now and then: what was waited for had no chance to be heard."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from bench.errors import LinkError, RotorNotArrived
from drivers import waiting


def late() -> LinkError:
    return LinkError("late")


class Clock:
    """Virtual time; the sleeps of the given numbers last seconds longer."""

    def __init__(self, pauses_s: dict[int, float]) -> None:
        self.now, self.slept, self._pauses, self._count = 0, 0.0, pauses_s, 0

    def now_ns(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept += seconds
        self.now += round((seconds + self._pauses.get(self._count, 0.0)) * 1e9)
        self._count += 1


def after(clock: Clock, seconds: float) -> Callable[[], bool]:
    """True when the bench has run for so long."""
    return lambda: clock.slept >= seconds


def test_a_pause_of_the_bench_counts_for_a_fifth_of_a_second() -> None:
    clock = Clock({2: 30.0})
    waiting.until(after(clock, 0.25), 0.5, late, clock, clock.now_ns)
    clock = Clock({2: 30.0})
    with pytest.raises(LinkError, match="late"):
        waiting.until(after(clock, 0.45), 0.5, late, clock, clock.now_ns)


def test_without_a_pause_the_limit_is_what_it_says() -> None:
    clock = Clock({})
    with pytest.raises(LinkError, match="late"):
        waiting.until(lambda: False, 0.5, late, clock, clock.now_ns)
    assert clock.slept == pytest.approx(0.5, abs=0.002)


def test_what_is_to_keep_true_is_waited_for_over_a_pause() -> None:
    clock = Clock({3: 30.0})
    waiting.keep(after(clock, 1.2), 1.0, 2.0, lambda: "late", clock, clock.now_ns)
    clock = Clock({})
    with pytest.raises(RotorNotArrived, match="late"):
        waiting.keep(lambda: False, 1.0, 2.0, lambda: "late", clock, clock.now_ns)
    assert clock.slept == pytest.approx(2.0, abs=0.11)


def test_a_bench_that_hardly_runs_gives_up_all_the_same() -> None:
    clock = Clock(dict.fromkeys(range(1000), 1.0))
    with pytest.raises(LinkError, match="late"):
        waiting.until(lambda: False, 0.5, late, clock, clock.now_ns)
