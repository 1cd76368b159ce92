"""Bench time follows wall time: how many control ticks are due, and what happens when the machine was too slow."""

from __future__ import annotations

from dataclasses import dataclass

TICK_NS = 100_000
SLICE_NS = 2_000_000
LATE_NS = 20_000_000
DEBT_NS = 10_000_000_000
LONGEST_NS = 7_500_000  # bench time in one slice


@dataclass
class Pacer:
    """Bench time that follows wall time from `start_ns` on. It never skips bench time unless it says so.

    After a pause of this process it catches up at three halves of wall time, in short slices. A host whose
    heartbeats come every 20 ms of wall time, also if one is lost, then still meets a watchdog of 80 ms of bench time:
    that this process got no processor must not look like a dead host.
    """

    start_ns: int
    tick_ns: int = TICK_NS
    ticks: int = 0  # run since the start
    overruns: int = 0  # slices that started over 20 ms late
    worst_ns: int = 0  # the latest start of a slice
    drops: int = 0  # how often a debt over ten seconds was dropped
    dropped_ns: int = 0
    _last_ns: int = -1
    _allowed_ns: int = 0  # bench time that may be run at most

    def bench_ns(self) -> int:
        """The wall time that the present tick stands for, UNIX ns."""
        return self.start_ns + self.dropped_ns + self.ticks * self.tick_ns

    def due(self, now_ns: int) -> int:
        """Ticks to run now; they count as run. 0 when the next one is not due yet."""
        passed = SLICE_NS if self._last_ns < 0 else max(now_ns - self._last_ns, 0)
        self._last_ns = now_ns
        late = passed - SLICE_NS
        self.worst_ns = max(self.worst_ns, late)
        self.overruns += late > LATE_NS
        behind = now_ns - self.bench_ns()
        if behind > DEBT_NS:
            self.drops += 1
            self.dropped_ns += behind - SLICE_NS
            behind = SLICE_NS
        self._allowed_ns = min(self._allowed_ns + passed * 3 // 2, LONGEST_NS)
        ticks = max(min(behind, self._allowed_ns), 0) // self.tick_ns
        self._allowed_ns -= ticks * self.tick_ns
        self.ticks += ticks
        return ticks

    def wait_s(self, now_ns: int) -> float:
        """How long until the next slice should start."""
        return min(max(self._last_ns + SLICE_NS - now_ns, 0), SLICE_NS) * 1e-9
