"""Time. Inside Levbench it is integer nanoseconds since the UNIX epoch, from one clock that the rig owns."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol


class Clock(Protocol):
    """A clock that can be slept on. In simulation, sleeping is what advances the machine."""

    def now_ns(self) -> int:
        """The present, UNIX ns."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let that much bench time pass."""
        ...


class WallClock:
    """The host's clock, for live rigs: UNIX time at the start, then the monotonic clock, so that it never steps."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        return self._offset_ns + time.monotonic_ns()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)


class PumpedClock:
    """A clock that looks after the rig while the procedure sleeps: after each slice it calls `pump`.

    `pump` reads the links, records, decodes, checks the envelope and the supervisor; it may raise, which is how an
    interlock ends a procedure in the middle of a sleep.
    """

    def __init__(
        self, base: Clock, pump: Callable[[], None], slice_s: float = 0.1, lag_ns: Callable[[], int] = lambda: 0
    ) -> None:
        self._base, self._pump, self._slice_s, self._lag_ns = base, pump, slice_s, lag_ns
        self._latest = 0

    def now_ns(self) -> int:
        """The present on the sample clock: the base's time less its lag behind the device's; never goes back."""
        self._latest = max(self._latest, self._base.now_ns() - self._lag_ns())
        return self._latest

    def sleep(self, seconds: float) -> None:
        left = seconds
        while left > 1e-9:
            part = min(left, self._slice_s)
            self._base.sleep(part)
            left -= part
            self._pump()
