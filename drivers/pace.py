"""How often a reader wakes up: at once while little comes, about a thousand times a second while much does."""

from __future__ import annotations

import time
from collections.abc import Callable

PERIOD_S = 0.001
BURST = 4


class Pace:
    """Called before each read that may find data. A single frame or reply is never held up; a steady stream of them
    is taken in portions, since a wake-up costs as much as fifty frames.
    """

    def __init__(
        self,
        period_s: float = PERIOD_S,
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._period, self._now, self._sleep = period_s, now, sleep
        self._credit = float(BURST)
        self._last = now()

    def wait(self) -> None:
        """Wait for a period when the reads of late came faster than one a period."""
        now = self._now()
        self._credit = min(float(BURST), self._credit + (now - self._last) / self._period)
        self._last = now
        if self._credit < 1.0:
            self._sleep(self._period)
            self._last = self._now()  # what the sleep earned is spent
        else:
            self._credit -= 1.0
