"""Time. Inside Levbench it is integer nanoseconds since the UNIX epoch, from one clock that the rig owns."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

WHOLE_NS: Final = 1e-3
"""So far from a whole number of nanoseconds a tick is one all the same."""


class Clock(Protocol):
    """A clock that can be slept on. In simulation, sleeping is what advances the machine."""

    def now_ns(self) -> int:
        """The present, UNIX ns."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let that much bench time pass."""
        ...


class TickClock:
    """A device's ticks as nanoseconds. A tick need not be a whole number of them (280 kHz: 25 us are seven).

    Args:
        tick_s: of the device.
    """

    def __init__(self, tick_s: float) -> None:
        exact = tick_s * 1e9
        self.tick_ns = round(exact) if abs(exact - round(exact)) < WHOLE_NS else exact

    def ns(self, ticks: int) -> int:
        """So many ticks, ns."""
        return round(ticks * self.tick_ns)

    def all_ns(self, ticks: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """So many ticks each, ns (n,)."""
        if isinstance(self.tick_ns, int):
            return np.asarray(ticks * self.tick_ns, np.int64)
        out: npt.NDArray[np.int64] = np.rint(ticks * self.tick_ns).astype(np.int64)
        return out

    def ticks(self, seconds: float) -> float:
        """Ticks in a time; whole where it is a whole number of them."""
        exact = seconds * 1e9 / self.tick_ns
        return float(round(exact)) if abs(exact - round(exact)) < 1e-6 * max(exact, 1.0) else exact


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
