"""Device ticks against the host's clock: drift, lateness, and where on the sample clock a host time lies.

The sample clock is the device's: ticks times the tick's length plus one offset, fixed at the first sample. Host times of
arrival are later by a latency that is never negative and has no bound. In windows of a second the least of it is what
the transport needs at best; the slope of those minima over device time is the drift of the two clocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.link.clockrate import GROSS, ClockRate

WINDOW_NS = 1_000_000_000
MAX_DRIFT = 200e-6  # two crystals differ by less; what goes faster is latency
JITTER_NS = 2_000_000
FEWEST, MOST = 8, 600  # windows for a slope
FASTEST = 0.01  # no clock that is read for its drift by windows gains more; bench.link.clockrate sees those that do


@dataclass(frozen=True, slots=True)
class Drift:
    """Host clock against device clock: `ppm` is positive when the host's runs faster; U at 95 %, and how many windows."""

    ppm: float
    expanded_ppm: float
    windows: int


class HostMap:
    """Fed with the sample time and the host time of each arrival."""

    def __init__(self, latest_ns: int = 0) -> None:
        self._first_ns: int | None = None
        self._minima: list[tuple[int, int]] = []  # sample time and least lateness of each finished window
        self._window = 0
        self._earliest_ns = 0  # the least lateness ever, less the drift that there may have been until then
        self._least: tuple[int, int] | None = None
        self.latest_ns = latest_ns  # greatest lateness beyond drift
        self.lag_ns = 0  # host time less this is sample time
        self.rate = ClockRate()
        self.beyond = 0  # the last windows in a row that are later than drift can make, and do not catch up

    def take(self, samples_ns: npt.NDArray[np.int64], hosts_ns: npt.NDArray[np.int64]) -> None:
        """One batch: sample times and when each arrived."""
        lateness = hosts_ns - samples_ns
        best = int(lateness.argmin())
        sample_ns, late = int(samples_ns[best]), int(lateness[best])
        self.rate.take(sample_ns, int(hosts_ns[best]))
        if self._first_ns is None:
            self._first_ns = sample_ns
        window = (sample_ns - self._first_ns) // WINDOW_NS
        if window != self._window and self._least is not None:
            self._finish(self._least)
            self._window, self._least = window, None
        if self._least is None or late < self._least[1]:
            self._least = (sample_ns, late)
        # Earlier than ever is a proof that the first sample itself was late; later than any drift is latency.
        self.lag_ns = min(self._bound(sample_ns), *(x for _, x in [*self._minima[-2:], self._least]))
        self._earliest_ns = min(self._earliest_ns, late - self._drift_ns(sample_ns))
        self.latest_ns = max(self.latest_ns, int(lateness.max()) - self.lag_ns)

    def _bound(self, sample_ns: int) -> int:
        return self._earliest_ns + JITTER_NS + self._drift_ns(sample_ns)

    def _drift_ns(self, sample_ns: int) -> int:
        assert self._first_ns is not None
        return round(MAX_DRIFT * (sample_ns - self._first_ns))

    def _finish(self, least: tuple[int, int]) -> None:
        before = self._minima[-1][1] if self._minima else least[1]
        gains = least[1] < before - JITTER_NS  # what stood still comes back, a clock does not
        self.beyond = self.beyond + 1 if least[1] > self._bound(least[0]) and not gains else 0
        self._minima.append(least)

    @property
    def unknown_s(self) -> float:
        """How long telemetry has come, where nothing tells the rate of the device's clock; else 0."""
        return 0.0 if self.rate.line() is not None or self.drift() is not None else self.rate.seconds

    def drift(self) -> Drift | None:
        """Slope of the windows' minima (Theil and Sen: no latency of a few windows moves it) but of those that a later,
        much earlier one proves late; None with too few windows, or where nothing varies (simulation). A clock that is off
        by half a per cent or more is read from the line of `bench.link.clockrate`."""
        line = self.rate.line()
        if line is not None and abs(line.slope) - line.expanded > GROSS:
            return Drift(line.slope * 1e6, line.expanded * 1e6, line.points)
        points = np.array(self._minima[1:], float).reshape(-1, 2)  # the first window may be short
        least = points[:, 1] + FASTEST * points[:, 0]
        points = points[least <= np.minimum.accumulate(least[::-1])[::-1] + JITTER_NS]
        if len(points) < FEWEST or np.ptp(points[:, 1]) == 0:
            return None
        from scipy import stats  # half a second to import, and only a live run needs it

        points = points[:: -(-len(points) // MOST)]
        x, y = points[:, 0] - points[0, 0], points[:, 1] - points[0, 1]
        slope, _, low, high = stats.theilslopes(y, x, 0.95)
        return Drift(float(slope) * 1e6, float(high - low) / 2 * 1e6, len(points))
