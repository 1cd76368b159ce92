"""Device ticks against the host's clock: drift, lateness, and where on the sample clock a host time lies.

The sample clock is the device's: ticks times the tick's length plus one offset, fixed at the first sample. Host times of
arrival are later by a latency that is never negative and has no bound. In windows of a second the least of it is what
the transport needs at best; the slope of those minima over device time is the drift of the two clocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

WINDOW_NS = 1_000_000_000
MAX_DRIFT = 200e-6  # two crystals differ by less; what goes faster is latency
JITTER_NS = 2_000_000


@dataclass(frozen=True, slots=True)
class Drift:
    """Host clock against device clock: `ppm` is positive when the host's runs faster; U at 95 % with its dof."""

    ppm: float
    expanded_ppm: float
    dof: int


class HostMap:
    """Fed with the sample time and the host time of each arrival."""

    def __init__(self, latest_ns: int = 0) -> None:
        self._first_ns: int | None = None
        self._minima: list[tuple[int, int]] = []  # sample time and least lateness of each finished window
        self._window = 0
        self._least: tuple[int, int] | None = None
        self.latest_ns = latest_ns  # greatest lateness beyond drift
        self.lag_ns = 0  # host time less this is sample time

    def take(self, sample_ns: int, host_ns: int) -> None:
        """One arrival: the newest sample of a batch and when it came."""
        if self._first_ns is None:
            self._first_ns = sample_ns
        late, window = host_ns - sample_ns, (sample_ns - self._first_ns) // WINDOW_NS
        if window != self._window and self._least is not None:
            self._minima.append(self._least)
            self._window, self._least = window, None
        if self._least is None or late < self._least[1]:
            self._least = (sample_ns, late)
        bound = JITTER_NS + round(MAX_DRIFT * (sample_ns - self._first_ns))
        seen = min(x for _, x in [*self._minima[-2:], self._least])
        self.lag_ns = max(-bound, min(bound, seen))
        self.latest_ns = max(self.latest_ns, late - self.lag_ns)

    def drift(self) -> Drift | None:
        """Slope of the windows' minima; None with fewer than four windows or where nothing varies (simulation)."""
        points = np.array(
            [p for p in self._minima if abs(p[1]) <= JITTER_NS + MAX_DRIFT * (p[0] - (self._first_ns or 0))]
        )
        if len(points) < 4 or np.ptp(points[:, 1]) == 0:
            return None
        x, y = points[:, 0] - points[0, 0], points[:, 1].astype(float)
        fit = stats.linregress(x.astype(float), y)
        dof = len(points) - 2
        return Drift(float(fit.slope) * 1e6, float(stats.t.ppf(0.975, dof) * fit.stderr) * 1e6, dof)
