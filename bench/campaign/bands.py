"""Do the intervals hold the truth, and are they padded? Coverage and width over many virtual rigs, against their bands.

Coverage is the share of rigs whose 95 % interval holds the truth; its band is 0.95 -+ 3.3 sqrt(0.95 0.05 / N). A rig
without a value counts as one that missed. Width is one over the 95th percentile of |error|/U: by how much the intervals
could all be divided and still hold 95 % of the truths; its band is 0.8 to 1.25 (decision 0012). What the percentile is
worth over N rigs follows from order statistics, whatever the distribution: with fewer than 59 rigs even the largest error
is not beyond the 95th percentile with 95 % confidence (1 - 0.95^59 = 0.95), so that nothing is decided.

Tails: errors beyond 2 U, 3 U and 10 U, U being the half width on the side towards the truth, are counted, and may not be more
than the 99.9 % quantile (Bonferroni over the quantities that are judged) of what each interval says of itself: t with its
degrees of freedom, or the share of its JCGM 101 draws that lies so far out. With eight degrees of freedom two of 300 may lie
beyond 3 U, and a jump that the interval missed among them; beyond 10 U there should be none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import beta, binom

from bench.record.limits import Verdict
from bench.uncertainty.tails import MULTIPLES, Tails

Array = npt.NDArray[np.float64]
P = 0.95
LEAST = 59
LEVEL = 0.001  # of a sound campaign has more errors so far out, in any quantity
WIDTH_BAND = (0.8, 1.25)


@dataclass(frozen=True)
class Sample:
    """One quantity of one rig: error of the value, interval bounds relative to the truth, half width U, and how probable the
    interval takes errors beyond multiples of the half width to be."""

    error: float
    low: float
    high: float
    U: float
    tails: Tails

    @property
    def holds(self) -> bool:
        return self.low <= 0.0 <= self.high

    @property
    def ratio(self) -> float:
        """Error over the interval's half width on the side towards the truth; inf where there is none."""
        half = self.error - self.low if self.error > 0 else self.high - self.error
        return self.error / half if half > 0 else math.copysign(math.inf, self.error) if self.error else 0.0


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
class Tail:
    """Errors beyond `multiple` half widths: how many there are, how many are to be expected, and how many there may be."""

    multiple: float
    found: int
    expected: float
    most: int

    @property
    def verdict(self) -> Verdict:
        return Verdict.FAIL if self.found > self.most else Verdict.PASS


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
    tails: tuple[Tail, ...]
    seeds: tuple[int, ...]
    samples: tuple[Sample, ...]
    monte_carlo: int

    @property
    def verdict(self) -> Verdict:
        """Of coverage, width and tails, the worst."""
        return Verdict.FAIL if any(t.verdict is Verdict.FAIL for t in self.tails) else self.coverage.verdict

    @property
    def farthest(self) -> tuple[tuple[int, float], ...]:
        """Seeds and ratios of the errors beyond the interval's double, the greatest first."""
        found = [
            (seed, s.ratio) for seed, s in zip(self.seeds, self.samples, strict=True) if abs(s.ratio) > MULTIPLES[0]
        ]
        return tuple(sorted(found, key=lambda item: -abs(item[1])))


@dataclass(frozen=True)
class Unable:
    """Machines that cannot do a step, out of `rigs`: their seeds and why. They count in no coverage."""

    step: int
    procedure: str
    rigs: int
    which: tuple[tuple[int, str], ...]

    @property
    def share(self) -> float:
        return len(self.which) / self.rigs

    @property
    def interval(self) -> tuple[float, float]:
        """Of the share, 95 % (Clopper and Pearson)."""
        k, n, tail = len(self.which), self.rigs, (1 - P) / 2
        low = float(beta.ppf(tail, k, n - k + 1)) if k else 0.0
        return low, float(beta.ppf(1 - tail, k + 1, n - k)) if k < n else 1.0


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


def tails(samples: Sequence[Sample], judged: int) -> tuple[Tail, ...]:
    """The errors beyond the multiples of the half width of one quantity, of `judged` that are judged."""
    found = []
    for n, multiple in enumerate(MULTIPLES):
        expected = [s.tails[n] for s in samples]
        most = _most(expected, LEVEL / max(judged, 1))
        found.append(Tail(multiple, sum(abs(s.ratio) > multiple for s in samples), math.fsum(expected), most))
    return tuple(found)


def _most(probabilities: Sequence[float], level: float) -> int:
    """The least number that the count of independent events of these probabilities exceeds with at most probability `level`."""
    mass = np.ones(1)
    for p in probabilities:
        mass = np.convolve(mass, (1 - p, p))
    beyond = np.append(np.cumsum(mass[::-1])[::-1][1:], 0.0)  # from the small end, for the sake of digits
    return int(np.argmax(beyond <= level))


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
