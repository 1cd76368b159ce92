"""Do the intervals hold the truth, and are they padded? Coverage and width over many virtual rigs, against their bands.

Coverage is the share of rigs whose 95 % interval holds the truth; its band is 0.95 -+ 3.3 sqrt(0.95 0.05 / N). A rig
without a value counts as one that missed. Width is one over the 95th percentile of |error|/U: by how much the intervals
could all be divided and still hold 95 % of the truths; its band is 0.8 to 1.25 (decision 0012). What the percentile is
worth over N rigs follows from order statistics, whatever the distribution: with fewer than 59 rigs even the largest error
is not beyond the 95th percentile with 95 % confidence (1 - 0.95^59 = 0.95), so that nothing is decided.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import binom

from bench.limits import Verdict

Array = npt.NDArray[np.float64]
P = 0.95
LEAST = 59
WIDTH_BAND = (0.8, 1.25)


@dataclass(frozen=True)
class Sample:
    """One quantity of one rig: error of the value, interval bounds relative to the truth, half width U."""

    error: float
    low: float
    high: float
    U: float

    @property
    def holds(self) -> bool:
        return self.low <= 0.0 <= self.high


@dataclass(frozen=True)
class Coverage:
    """One quantity over `rigs` rigs, of which `values` gave a value. Numbers are None where there is no value.

    `width_range` is what `width` may be, 95 %, as the percentile is known from so many rigs only; an open end is inf.
    `pooled_width` is the mean U over the 95th percentile of |error|, for information: the same where U is the same for all.
    """

    rigs: int
    values: int
    hits: int
    coverage: float
    band: tuple[float, float]
    width: float | None
    width_range: tuple[float, float] | None
    pooled_width: float | None
    mean_U: float | None
    bias: float | None  # mean error over the standard deviation of the errors
    coverage_verdict: Verdict
    width_verdict: Verdict

    @property
    def verdict(self) -> Verdict:
        found = (self.coverage_verdict, self.width_verdict)
        return next((v for v in (Verdict.FAIL, Verdict.INDETERMINATE) if v in found), Verdict.PASS)


@dataclass(frozen=True)
class Quantity:
    """One quantity of a step over the rigs. `judged` ones decide; `samples` are in the order of the rigs that gave a
    value."""

    step: int
    procedure: str
    name: str
    unit: str
    about: str
    judged: bool
    coverage: Coverage
    seeds: tuple[int, ...]
    samples: tuple[Sample, ...]
    monte_carlo: int


@dataclass(frozen=True)
class Failure:
    """A finding's code: in which step, its effect, on how many rigs, and one that shows it."""

    step: int
    procedure: str
    code: str
    effect: str
    rigs: int
    example: int
    text: str


def band(rigs: int) -> tuple[float, float]:
    """Where the coverage over that many rigs may lie."""
    half = 3.3 * math.sqrt(P * (1 - P) / rigs)
    return max(P - half, 0.0), min(P + half, 1.0)


def coverage(samples: Sequence[Sample], rigs: int) -> Coverage:
    """Judge one quantity: `samples` of the rigs that gave a value, out of `rigs`."""
    hits = sum(s.holds for s in samples)
    share, limits = hits / rigs, band(rigs)
    inside = limits[0] <= share <= limits[1]
    enough = rigs >= LEAST
    first = (Verdict.PASS if enough else Verdict.INDETERMINATE) if inside else Verdict.FAIL
    if not samples:
        return Coverage(rigs, 0, 0, share, limits, None, None, None, None, None, Verdict.FAIL, Verdict.INDETERMINATE)
    errors, wide = np.array([s.error for s in samples]), np.array([s.U for s in samples])
    mean_u = float(np.mean(wide))
    width, reach = _width(np.abs(errors), wide)
    percentile = float(np.percentile(np.abs(errors), 100 * P))
    pooled = mean_u / percentile if percentile > 0 else None
    spread = float(errors.std(ddof=1)) if len(errors) > 1 else 0.0
    bias = float(errors.mean()) / spread if spread > 0 else 0.0
    second = _judged(width, reach) if enough and len(samples) >= LEAST else Verdict.INDETERMINATE
    return Coverage(rigs, len(samples), hits, share, limits, width, reach, pooled, mean_u, bias, first, second)


def _width(magnitudes: Array, expanded: Array) -> tuple[float | None, tuple[float, float] | None]:
    ratios = np.divide(magnitudes, expanded, out=np.where(magnitudes > 0, np.inf, 0.0), where=expanded > 0)
    n, ordered = len(ratios), np.sort(ratios)
    percentile = float(np.quantile(ratios, P, method="higher" if np.isinf(ordered[-1]) else "linear"))
    if percentile == 0:
        return None, None
    low, high = int(binom.ppf(0.025, n, P)), int(binom.ppf(0.975, n, P)) + 1  # ranks from 1
    least = float(ordered[max(low, 1) - 1])
    most = float(ordered[high - 1]) if high <= n else math.inf
    return 1 / percentile, (1 / most, 1 / least if least > 0 else math.inf)


def _judged(width: float | None, reach: tuple[float, float] | None) -> Verdict:
    """Fail only where so many rigs leave no doubt; indeterminate where more rigs might bring it inside."""
    if width is None or reach is None:
        return Verdict.INDETERMINATE
    if WIDTH_BAND[0] <= width <= WIDTH_BAND[1]:
        return Verdict.PASS
    return Verdict.FAIL if reach[1] < WIDTH_BAND[0] or reach[0] > WIDTH_BAND[1] else Verdict.INDETERMINATE
