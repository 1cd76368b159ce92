"""The trend of a quantity: control charts and drift of each segment of its history in which nothing was changed on purpose.

A segment has the runs of one plan, with one set of parameters (bias), certificates, calibrations and firmware: no line is drawn
across a change of these. Its first runs are the baseline (phase I) of its charts; the runs after them are watched (phase II).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from bench.errors import ConfigError
from bench.figures import Array
from bench.history import charts
from bench.history.anova import one_way
from bench.history.charts import WIDTH, Limits
from bench.history.drift import Drift, chi2_ratio, fitted, t_factor
from bench.history.series import History

if TYPE_CHECKING:
    from bench.run.indexrow import Result

BASELINE = 8  # runs from which there are limits
WEIGHT = 0.2  # of the newest value in the EWMA: 0.2 to 0.3 sees slow drifts (Hunter 1986; handbook, 6.3.2.4)
LEAST_WEIGHT = 0.05
ALLOWANCE = (
    0.5  # of the CUSUM that dates a change, in standard deviations: the best for shifts of one (handbook, 6.3.2.3)
)
FARTHEST = 5.0  # times the time observed: the line is not believed beyond


@dataclass(frozen=True)
class Chart:
    """Charts of a segment: `limits` of the individuals chart, from the first `baseline` runs; of the runs after them EWMA, its
    lower and its upper limits (n - baseline,)."""

    limits: Limits
    baseline: int
    ewma: Array
    ewma_lower: Array
    ewma_upper: Array


@dataclass(frozen=True)
class Signal:
    """A chart's first value beyond its limits, by its place in the segment; the change began at `began`, as the CUSUM has it:
    the first run since which its sum is not zero (Montgomery, Statistical Quality Control, 9.1)."""

    chart: Literal["individuals", "EWMA"]
    at: int
    upward: bool
    began: int


@dataclass(frozen=True)
class Segment:
    """Runs between two changes. `changed` says what differs from the segment before of the same plan, or that the plan does
    from the one that began last; `against` is the number of that segment, None for the first."""

    results: tuple[Result, ...]
    times: Array
    values: Array
    changed: tuple[str, ...]
    chart: Chart | None
    signals: tuple[Signal, ...]
    drift: Drift | None
    against: int | None

    @property
    def expanded(self) -> Array:
        """U of each run; NaN where the record states none."""
        return np.array([np.nan if r.U is None else r.U for r in self.results])

    @property
    def beyond(self) -> list[bool]:
        """Whether each value lies outside the individuals chart's limits, in the baseline too."""
        c = self.chart
        return [c is not None and not c.limits.lower <= v <= c.limits.upper for v in self.values.tolist()]

    @property
    def ewma_beyond(self) -> list[bool]:
        """The same of the EWMA after the baseline."""
        c = self.chart
        if c is None:
            return [False] * len(self.results)
        outside = (c.ewma < c.ewma_lower) | (c.ewma > c.ewma_upper)
        return [False] * c.baseline + [bool(o) for o in outside]

    @property
    def overdue(self) -> list[bool]:
        """Whether each value rests on a certificate that was past its due date on the day of its run, as its record says."""
        return [bool(r.overdue) for r in self.results]

    @property
    def wide(self) -> list[bool]:
        """Whether a run's own U exceeds the half width of the limits: its value is less sure than the chart is narrow."""
        return [self.chart is not None and bool(u > self.chart.limits.half) for u in self.expanded]

    @property
    def excess(self) -> float | None:
        """Scatter over the rms of the standard uncertainties, where that is more than chance allows (99 %): something moves the
        values that no budget has. None otherwise."""
        stated = [r.u for r in self.results if r.u]
        if self.drift is None or len(stated) < len(self.results):
            return None
        ratio = self.drift.scatter**2 / float(np.mean(np.square(stated)))
        return ratio**0.5 if ratio > chi2_ratio(self.drift.dof) else None


@dataclass(frozen=True)
class Reach:
    """When the 95 % band of a segment's drift reaches a limit; None if not within FARTHEST times the time observed, which is
    until `asked`."""

    limit: float
    upward: bool
    time: float | None
    asked: float


@dataclass(frozen=True)
class Trend:
    """The history of one quantity in segments, oldest first."""

    history: History
    segments: tuple[Segment, ...]
    weight: float

    @property
    def name(self) -> str:
        return self.history.results[0].name

    @property
    def unit(self) -> str:
        return self.history.results[0].unit

    @property
    def newest(self) -> Segment:
        """The segment that the newest run is in."""
        return max(self.segments, key=lambda s: float(s.times[-1]))


@dataclass(frozen=True)
class Step:
    """By how much a segment's mean differs from that of the one it is held against, with its 95 % interval, from the scatter
    within all."""

    change: float
    half: float


def trend(history: History, *, weight: float = WEIGHT, baseline: int = BASELINE) -> Trend:
    """Charts and drifts of a history.

    Raises:
        ConfigError: the weight of the EWMA is not 0.05 to 1, or the baseline shorter than 8 runs.
    """
    if not LEAST_WEIGHT <= weight <= 1:
        raise ConfigError(
            f"--lambda: found {weight:g}; expected {LEAST_WEIGHT} to 1. Next: 0.2 for slow drifts, 0.4 for steps"
        )
    if baseline < BASELINE:
        raise ConfigError(f"--baseline: found {baseline}; expected {BASELINE} or more. Next: leave it out")
    return Trend(history, tuple(_segment(part, weight, baseline) for part in _parted(history)), weight)


@dataclass
class _Part:
    """Runs and times of a segment that grows; `known` is the newest run with what it does not say as it was before."""

    results: list[Result]
    times: list[float]
    known: Result
    changed: tuple[str, ...]
    against: int | None


def _parted(history: History) -> list[_Part]:
    """The runs of each segment; of plans that take turns each has its own."""
    parts: list[_Part] = []
    of_plan: dict[str, int] = {}
    for result, time in zip(history.results, history.times, strict=True):
        before = of_plan.get(result.settings)
        changed = ("plan",) if before is None else result.changed(parts[before].known)
        if before is None or changed:
            against = before if before is not None else len(parts) - 1 if parts else None
            of_plan[result.settings] = len(parts)
            parts.append(_Part([], [], result, changed if parts else (), against))
        part = parts[of_plan[result.settings]]
        part.results.append(result)
        part.times.append(time)
        part.known = result.filled(part.known)
    return parts


def _segment(part: _Part, weight: float, baseline: int) -> Segment:
    values, at = np.array([r.value for r in part.results], np.float64), np.array(part.times)
    chart = _chart(values, weight, baseline) if values.size >= baseline else None
    signals = () if chart is None else _signals(values, chart)
    return Segment(tuple(part.results), at, values, part.changed, chart, signals, fitted(at, values), part.against)


def _chart(values: Array, weight: float, baseline: int) -> Chart:
    limits = charts.individuals(values[:baseline])
    watched = values[baseline:]
    averaged = charts.ewma(watched, weight, limits.centre)
    half = WIDTH * limits.sigma * charts.ewma_sigmas(weight, watched.size)
    return Chart(limits, baseline, averaged, limits.centre - half, limits.centre + half)


def _signals(values: Array, chart: Chart) -> tuple[Signal, ...]:
    """The first signal of each chart after the baseline."""
    watched, limits = values[chart.baseline :], chart.limits
    sums = charts.cusum(watched, limits.centre, ALLOWANCE * limits.sigma)
    found: list[Signal] = []
    single = (watched < limits.lower) | (watched > limits.upper)
    averaged = (chart.ewma < chart.ewma_lower) | (chart.ewma > chart.ewma_upper)
    kinds: tuple[tuple[Literal["individuals", "EWMA"], Array, Sequence[bool]], ...] = (
        ("individuals", watched, single.tolist()), ("EWMA", chart.ewma, averaged.tolist()),
    )  # fmt: skip
    for kind, shown, beyond in kinds:
        if True in beyond:
            k = beyond.index(True)
            upward = bool(shown[k] > limits.centre)
            one = sums[0 if upward else 1][: k + 1]
            zeros = np.flatnonzero(one == 0)
            began = min(int(zeros[-1]) + 1 if zeros.size else 0, k)
            found.append(Signal(kind, chart.baseline + k, upward, chart.baseline + began))
    return tuple(found)


def reaches(segment: Segment) -> list[Reach]:
    """When the drift's band reaches the limits of the segment's newest run; none of fewer runs than a baseline has. All values
    may be off together by no more than that run's U, so that the band about the true value has it in root of the sum of
    squares."""
    drift, last = segment.drift, segment.results[-1]
    if drift is None or drift.count < BASELINE:
        return []
    now, first = float(segment.times[-1]), float(segment.times[0])
    asked = now + FARTHEST * (now - first)
    out = []
    for limit, upward in ((last.lower, False), (last.upper, True)):
        if limit is not None:
            time = drift.reaches(limit, upward, now, last.U or 0.0)
            out.append(Reach(limit, upward, time if time is not None and time <= asked else None, asked))
    return out


def steps(trend: Trend) -> list[Step | None]:
    """To each segment after the first from the one that it is held against; None where one of the two drifts, so that it has no
    level of its own, and where too few runs are in all to know the scatter within (one-way analysis)."""
    groups = [s.values for s in trend.segments]
    if len(groups) < 2 or sum(g.size for g in groups) <= len(groups):
        return [None] * (len(groups) - 1)
    found = one_way(groups)
    k = t_factor(found.dof_within) * found.residual
    drifts = [s.drift is not None and s.drift.shown for s in trend.segments]
    pairs = [(s.against or 0, b) for b, s in enumerate(trend.segments)][1:]
    return [None if drifts[a] or drifts[b] else Step(float(np.mean(groups[b]) - np.mean(groups[a])),
                                                     k * (1 / groups[a].size + 1 / groups[b].size) ** 0.5)
            for a, b in pairs]  # fmt: skip
