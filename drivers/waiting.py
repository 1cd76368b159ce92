"""Waiting on a bench's clock: until something is true, or until it has kept true."""

from __future__ import annotations

from collections.abc import Callable

from bench.clock import Clock
from bench.errors import LinkError

SLICE_S, LONG_SLICE_S, PATIENCE = 0.01, 0.1, 0.2  # a wait looks again after a fifth of how long it has waited
KEPT_S, KEPT_SLICE_S = 0.1, 0.02  # what is to stand or to keep its speed is looked at so often for so long

Now = Callable[[], int]


def until(done: Callable[[], bool], timeout_s: float, error: LinkError, clock: Clock, now_ns: Now) -> None:
    """Let the clock run until something is true; `now_ns` is looked at without letting it run.

    Raises:
        LinkError: the given one, when time runs out.
    """
    begin = now_ns()
    while not done():
        waited = now_ns() - begin
        if waited >= timeout_s * 1e9:
            raise error
        clock.sleep(min(_pause(waited), max(timeout_s - waited * 1e-9, 1e-3)))


def keep(
    ok: Callable[[], bool], expected_s: float, timeout_s: float, text: Callable[[], str], clock: Clock, now_ns: Now
) -> None:
    """Let the clock run for the time that it should take, and on until something has been true for a tenth of a second.

    Raises:
        LinkError: `text`, when time runs out.
    """
    begin, since = now_ns(), None
    clock.sleep(min(expected_s, timeout_s))
    while True:
        now = now_ns()
        if not ok():
            since = None
        elif since is None:
            since = now
        elif now - since >= KEPT_S * 1e9:
            return
        if now - begin > timeout_s * 1e9:
            raise LinkError(text())
        clock.sleep(_pause(now - begin) if since is None else KEPT_SLICE_S)


def _pause(waited_ns: int) -> float:
    """How long to wait before looking again, s."""
    return min(max(PATIENCE * waited_ns * 1e-9, SLICE_S), LONG_SLICE_S)
