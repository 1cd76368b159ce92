"""Waiting on a bench's clock: until something is true, or until it has kept true."""

from __future__ import annotations

from collections.abc import Callable

from bench.clock import Clock
from bench.errors import BenchError, RotorNotArrived
from bench.rigfile import RigFile

SLICE_S, LONG_SLICE_S, PATIENCE = 0.01, 0.1, 0.2  # a wait looks again after a fifth of how long it has waited
KEPT_S, KEPT_SLICE_S = 0.1, 0.02  # what is to stand or to keep its speed is looked at so often for so long

Now = Callable[[], int]
SILENCE_S = 0.5
STALL_NS = 200_000_000  # no wait is that long in one piece: the bench stood still, and could not hear what came


def patience_s(rig: RigFile) -> float:
    """How long a controller may say nothing: half a second, or as long as it waits for a silent host itself."""
    watchdog = rig.parameters.get(rig.capabilities.watchdog)
    return max(SILENCE_S, watchdog.default if watchdog else 0.0)


class Stopwatch:
    """How long the bench has waited, ns. Of a time in which its computer did not let it run no more than a fifth of a second
    counts: what it waits for had no chance to be heard."""

    def __init__(self, now_ns: Now) -> None:
        self._now_ns, self._last, self._ns = now_ns, now_ns(), 0

    def look(self) -> int:
        """The time so far; to be looked at in each turn of a wait."""
        before, self._last = self._last, self._now_ns()
        self._ns += min(self._last - before, STALL_NS)
        return self._ns


def until(
    done: Callable[[], bool], timeout_s: float, error: Callable[[], BenchError], clock: Clock, now_ns: Now
) -> None:
    """Let the clock run until something is true; `now_ns` is looked at without letting it run.

    Raises:
        BenchError: the given one, when time runs out.
    """
    watch = Stopwatch(now_ns)
    while not done():
        waited = watch.look()
        if waited >= timeout_s * 1e9:
            raise error()
        clock.sleep(min(_pause(waited), max(timeout_s - waited * 1e-9, 1e-3)))


def keep(
    ok: Callable[[], bool], expected_s: float, timeout_s: float, text: Callable[[], str], clock: Clock, now_ns: Now
) -> None:
    """Let the clock run for the time that it should take, and on until something has been true for a tenth of a second.

    Raises:
        RotorNotArrived: with `text`, when time runs out.
    """
    since, expected = None, min(expected_s, timeout_s)
    clock.sleep(expected)
    watch = Stopwatch(now_ns)
    while True:
        now = watch.look()
        if not ok():
            since = None
        elif since is None:
            since = now
        elif now - since >= KEPT_S * 1e9:
            return
        if now > (timeout_s - expected) * 1e9:
            raise RotorNotArrived(text())
        clock.sleep(_pause(now + round(expected * 1e9)) if since is None else KEPT_SLICE_S)


def _pause(waited_ns: int) -> float:
    """How long to wait before looking again, s."""
    return min(max(PATIENCE * waited_ns * 1e-9, SLICE_S), LONG_SLICE_S)
