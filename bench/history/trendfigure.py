"""A trend as a figure: values with their intervals, control limits and drift above, the EWMA with its limits below."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from bench.figures import Array, Figure, Series
from bench.history.series import machine
from bench.history.trend import Segment, Trend
from bench.history.trendunits import Told, moment, told

SPAN = 3.0  # times the height of values and limits: an acceptance limit farther off would flatten them
TICKS = 4
BEYOND, LIMITS = "beyond the limits", "control limits"
OVERDUE = "certificate past its due date"


def figure(trend: Trend) -> Figure:
    """The figure; x in days since the first run's day, or in visits. Each segment has its own curves, and none crosses a
    change."""
    t = told(trend)
    start = 0.0 if t.axis == "visit" else float(np.floor(trend.history.times[0]))
    named = _labels(trend)
    values = [x for k, s in enumerate(trend.segments) for x in _values(s, t, start, named[k])]
    averaged = [x for k, s in enumerate(trend.segments) for x in _averaged(s, t, start, named[k])]
    values, averaged = _told_once(values), _told_once(averaged)
    unit = f" ({t.unit})" if t.unit else ""
    lines, apart = _acceptance(trend, t, values)
    x_label = "visit" if t.axis == "visit" else "date, UTC"
    if any(x.style == "mark" for x in averaged) and not any(x.style == "mark" for x in values):
        values.append(Series(BEYOND, np.empty(0), np.empty(0), "mark"))  # the legend is the upper panel's
    upper = Figure(
        "trend", f"{trend.name} of {machine(trend.history.results[0])}", " ".join([_caption(trend), *apart]), x_label,
        f"{trend.name}{unit}", tuple(values), lines=lines, ticks=_ticks(trend, start), notes=tuple(_notes(trend, t, start)),
    )  # fmt: skip
    if not any(x.x.size for x in averaged):
        return upper
    lower = Figure("trend-ewma", "EWMA", "", x_label, f"EWMA{unit}", tuple(averaged), ticks=upper.ticks)
    return replace(upper, below=lower)


def _told_once(series: list[Series]) -> list[Series]:
    """With each kind of curve in the legend once."""
    seen: set[str] = set()
    out = []
    for one in series:
        again = one.label in seen and one.label in (BEYOND, OVERDUE, LIMITS)
        out.append(replace(one, label="") if again else one)
        seen.add(one.label)
    return out


def _labels(trend: Trend) -> list[str]:
    return ["value, 95 %"] if len(trend.segments) == 1 else [f"segment {k + 1}" for k in range(len(trend.segments))]


def _values(s: Segment, t: Told, start: float, label: str) -> Iterator[Series]:
    x, scale = s.times - start, t.one * 10.0**t.power
    yield Series(label, x, s.values / scale, "points", _bars(s) / scale)
    beyond = np.array(s.beyond)
    if beyond.any():
        yield Series(BEYOND, x[beyond], s.values[beyond] / scale, "mark")
    overdue = np.array(s.overdue)
    if overdue.any():
        yield Series(OVERDUE, x[overdue], s.values[overdue] / scale, "box")
    if s.chart is not None:
        limits = s.chart.limits
        ends = np.array([x[0], x[-1]])
        yield Series(LIMITS, *_closed(ends, limits.lower / scale, limits.upper / scale), "guide")
        yield Series("", ends, np.full(2, limits.centre / scale), "faint")
    if s.drift is not None and s.drift.shown:
        at = np.array([s.times[0], s.times[-1]])
        yield Series(f"{label}, fit", at - start, np.array([s.drift.at(a) for a in at]) / scale, "line")


def _averaged(s: Segment, t: Told, start: float, label: str) -> Iterator[Series]:
    """The EWMA; an empty curve where there is none, so that a segment has one colour in both panels."""
    if s.chart is None or s.chart.ewma.size == 0:
        yield Series(label, np.empty(0), np.empty(0), "both")
        return
    c, scale = s.chart, t.one * 10.0**t.power
    x = s.times[c.baseline :] - start
    yield Series(label, x, c.ewma / scale, "both")
    beyond = np.array(s.ewma_beyond[c.baseline :])
    if beyond.any():
        yield Series(BEYOND, x[beyond], c.ewma[beyond] / scale, "mark")
    yield Series(LIMITS, x, c.ewma_lower / scale, "guide")
    yield Series("", x, c.ewma_upper / scale, "guide")


def _bars(s: Segment) -> Array:
    return np.where(np.isfinite(s.expanded), s.expanded, 0.0)


def _closed(ends: Array, low: float, high: float) -> tuple[Array, Array]:
    """Both limits as one curve."""
    return np.array([ends[0], ends[1], ends[1], ends[0], ends[0]]), np.array([low, low, high, high, low])


def _acceptance(trend: Trend, t: Told, values: list[Series]) -> tuple[tuple[tuple[str, float], ...], list[str]]:
    """Limits of the newest run that fit the figure, and a sentence on those that do not."""
    last, scale = trend.newest.results[-1], t.one * 10.0**t.power
    low = min(float(np.min(s.y - (0 if s.u is None else s.u))) for s in values)
    high = max(float(np.max(s.y + (0 if s.u is None else s.u))) for s in values)
    room = (SPAN - 1) * (high - low)
    given = [
        (name, x / scale) for name, x in (("lower limit", last.lower), ("upper limit", last.upper)) if x is not None
    ]
    near = tuple((name, x) for name, x in given if low - room <= x <= high + room)
    far = [f"The {name}, {x:.5g}, lies outside the figure." for name, x in given if (name, x) not in near]
    return near, far


def _notes(trend: Trend, t: Told, start: float) -> Iterator[tuple[str, float, float]]:
    scale = t.one * 10.0**t.power
    for s in trend.segments:
        if s.changed:
            top = float(np.max(s.values + _bars(s))) / scale
            yield f"new {', '.join(s.changed)}", float(s.times[0]) - start, top


def _ticks(trend: Trend, start: float) -> tuple[tuple[str, float], ...]:
    """Dates at a few places of the axis; visits are numbers of their own."""
    if trend.history.axis == "visit":
        return ()
    first, last = trend.history.times[0], trend.history.times[-1]
    whole = last - first >= TICKS
    places = np.linspace(first, last, TICKS)
    at = np.unique(np.floor(places)) if whole else places
    return tuple((_date(a) if whole else moment(a)[5:], float(a) - start) for a in at)


def _date(days: float) -> str:
    return datetime.fromtimestamp(days * 86400, UTC).strftime("%Y-%m-%d")


def _caption(trend: Trend) -> str:
    n = len(trend.history.results)
    segments = len(trend.segments)
    first = next((s.chart for s in trend.segments if s.chart is not None), None)
    of = f"{n} runs" + (f" in {segments} segments; none of the lines crosses a change" if segments > 1 else "")
    if first is None:
        return f"{of}. Too few for control limits."
    return (f"{of}. Control limits by the moving range of the first {first.baseline} runs of a segment; EWMA of those after "
            f"them with weight {trend.weight:g} and exact limits.")  # fmt: skip
