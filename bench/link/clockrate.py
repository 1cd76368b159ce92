"""By which factor the device's clock is wrong, however gross: the straight line of its samples against the host's clock.

A latency is never negative, and nobody knows its bound: what stood still comes back, and for seconds a link or a computer
that catches up looks like a clock that is fast. But it comes back to where it was, and not all the time at one pace. A
clock is wrong where nearly all least latenesses, one in half a second of host time, lie on one line that goes on and on.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

SLICE_NS = 500_000_000
# So near the line the least of a slice is, to be read by it and to end a run by it; a computer that is too slow keeps to none.
TIGHT_NS, CERTAIN_NS = 5e6, 3e6
LOOSE = 0.001  # and by this share of what the clock is off in all: crystals warm up
GROSS = 0.005  # less is for bench.link.hosttime, by windows of a second
CERTAIN = 0.01  # a clock that is further off ends a run
FEWEST_SLOW, FEWEST_FAST = 10, 20  # slices for that; a backlog from before the first sample may look fast for a while
MOST = 300  # points of a line
ON, ON_CERTAIN, EARLY = 0.5, 0.9, 0.05  # shares of the points on a line, and of those that come before it
LAST_NS = 5_000_000_000

Floats = npt.NDArray[np.float64]


def described(ppm: float) -> str:
    """What a drift (positive: the host's clock is faster) says of the controller's clock."""
    rate = 1 / (1 + ppm * 1e-6)
    if abs(rate - 1) >= CERTAIN:
        return f"the controller's clock runs at {rate:.3f} of the rate that the rig file states"
    return f"the controller's clock runs {abs(ppm):.0f} ppm {'slow' if ppm > 0 else 'fast'} against the host's"


@dataclass(frozen=True, slots=True)
class Line:
    """Lateness over sample time, ns: slope, U of it at 95 %, how many points, and the shares of them on the
    line and before it."""

    slope: float
    expanded: float
    points: int
    on: float
    early: float


class ClockRate:
    """Fed with sample time and host time of the least late sample of each arrival."""

    def __init__(self) -> None:
        self._points: list[tuple[int, int]] = []  # sample time and lateness of each finished slice but the first
        self._first_ns: int | None = None  # host time, as all that follow
        self._slice = 0
        self._least: tuple[int, int] | None = None
        self.certain_ppm: float | None = None
        """Set when the clock is certainly off by a per cent or more; host's against device's."""

    def take(self, sample_ns: int, host_ns: int) -> None:
        """The least late sample of an arrival."""
        if self._first_ns is None:
            self._first_ns = host_ns
        number = (host_ns - self._first_ns) // SLICE_NS
        if number > self._slice and self._least is not None:
            if self._slice:  # the first sample may have waited
                self._points.append(self._least)
                self._judge()
            self._slice, self._least = number, None
        if self._least is None or host_ns - sample_ns < self._least[1]:
            self._least = (sample_ns, host_ns - sample_ns)

    @property
    def seconds(self) -> float:
        """Of host time in which telemetry came."""
        return len(self._points) * SLICE_NS * 1e-9

    @property
    def gained_ns(self) -> int:
        """By how much telemetry came earlier within the last five seconds than ever before; 0 in runs below ten seconds.
        What had been late and caught up came no earlier than before that."""
        points = np.array(self._points, np.int64).reshape(-1, 2)
        hosts = points.sum(axis=1)
        if not len(hosts) or hosts[-1] - hosts[0] < 2 * LAST_NS:
            return 0
        last = hosts >= hosts[-1] - LAST_NS
        return max(0, int(points[~last, 1].min() - points[last, 1].min()))

    def line(self) -> Line | None:
        """What most of all points lie on and hardly any comes before; None where there is no such line."""
        if len(self._points) < FEWEST_SLOW - 1:
            return None
        found = _line(np.array(self._points[:: -(-len(self._points) // MOST)], float), TIGHT_NS, LOOSE)
        return found if found.on >= ON and found.early <= EARLY else None

    def _judge(self) -> None:
        """A clock that is slow shows at once; one that is fast by getting ever earlier since the first sample."""
        if len(self._points) < FEWEST_SLOW:
            return
        slow = _line(np.array(self._points[-FEWEST_SLOW:], float), CERTAIN_NS)
        if slow.slope > 0:
            self._conclude(slow)
        elif len(self._points) >= FEWEST_FAST:
            self._conclude(
                _line(np.array(self._points[:: -(-len(self._points) // (2 * FEWEST_FAST))], float), CERTAIN_NS)
            )

    def _conclude(self, line: Line) -> None:
        off = abs(1 / (1 + line.slope) - 1)
        sure = line.on >= ON_CERTAIN and line.early == 0 and 10 * line.expanded < abs(line.slope)
        self.certain_ppm = line.slope * 1e6 if sure and off >= CERTAIN else None


def _line(points: Floats, tight_ns: float, loose: float = 0.0) -> Line:
    """Slope by the median of the slopes between all pairs (Theil and Sen), over points of sample time and lateness, ns."""
    x, y = points[:, 0] - points[0, 0], points[:, 1] - points[0, 1]
    slope, _ = _theil_sen(x, y)
    rest = y - slope * x
    rest -= np.median(rest)
    tolerance = tight_ns + loose * abs(slope) * x[-1]
    near = np.abs(rest) <= tolerance
    if near.sum() < 3:
        return Line(slope, np.inf, len(x), float(near.mean()), float((rest < -tolerance).mean()))
    slope, expanded = _theil_sen(x[near], y[near])
    return Line(slope, expanded, len(x), float(near.mean()), float((rest < -tolerance).mean()))


@lru_cache(maxsize=8)
def _pairs(n: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """First and second of all pairs of n points; kept, as every slice asks for the same few n."""
    first, second = np.triu_indices(n, 1)
    return first, second


def _theil_sen(x: Floats, y: Floats) -> tuple[float, float]:
    """Median of the slopes, and half of its interval at 95 % (Sen 1968: the rank correlation's normal limit)."""
    n = len(x)
    a, b = _pairs(n)
    apart = x[b] != x[a]
    slopes = np.sort((y[b] - y[a])[apart] / (x[b] - x[a])[apart])
    if not len(slopes):
        return 0.0, np.inf
    half = 1.96 * np.sqrt(n * (n - 1) * (2 * n + 5) / 18) / 2
    middle = len(slopes) / 2
    low, high = slopes[max(0, int(middle - half))], slopes[min(len(slopes) - 1, int(np.ceil(middle + half)))]
    return float(np.median(slopes)), float(high - low) / 2
