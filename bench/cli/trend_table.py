"""A trend on the terminal, in 80 columns: a line for each run with a strip of its chart, below each segment what it shows."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator
from itertools import repeat

from bench.history.runlength import no_signal
from bench.history.series import machine
from bench.history.trend import FARTHEST, Reach, Segment, Signal, Step, Trend, reaches, steps
from bench.history.trendunits import Told, told

WIDTH = 80
STRIP, LIMIT = 21, 7  # columns of the strip, and from its middle to a limit
MARKS = {
    "x": "value beyond its limits",
    "e": "EWMA beyond its limits",
    "w": "own U wider than the limits",
    "d": "rests on a certificate past its due date",
    "F": "FAIL",
    "?": "INDETERMINATE",
}
CHANCES = 60  # runs after the baseline up to which the chance of a false alarm is told


def text(trend: Trend, older: bool) -> str:
    """All of it; `older`: there are runs of before that were not asked for."""
    lines: list[str] = []
    for kind, said in parts(trend, older):
        lines += [""] if kind in ("segment", "marks") else []
        lines += said.split("\n") if kind == "rows" else _folded(said, 2 if kind == "note" else 0)
    return "\n".join(lines) + "\n"


def parts(trend: Trend, older: bool) -> Iterator[tuple[str, str]]:
    """What is told, by kind: `head`, and of each segment `segment` (how it differs from the one before, or nothing), `rows` in
    columns, and each `note` on it; at the end `marks`."""
    t = told(trend)
    yield from (("head", said) for said in _head(trend, t, older))
    many = len(trend.segments) > 1
    for k, (segment, step) in enumerate(zip(trend.segments, [None, *steps(trend)], strict=True)):
        yield "segment", _change(segment, step, k, t) if many else ""
        yield "rows", "\n".join(_rows(segment, t))
        yield from (("note", said) for said in _said(segment, t, trend.weight))
    used = {mark for segment in trend.segments for marks in _marks(segment) for mark in marks}
    if used:
        yield "marks", "marks: " + ", ".join(f"{m} {said}" for m, said in MARKS.items() if m in used)


def _head(trend: Trend, t: Told, older: bool) -> tuple[str, str]:
    first, times = trend.history.results[0], trend.history.times
    of = f"{trend.name} of {first.procedure} on {machine(first)}"
    span = f"{len(times)} runs, {t.when(times[0])} to {t.when(times[-1])}"
    left = [
        "older ones are neither shown nor in a baseline (--last)" if older else "",
        f"{trend.history.broken} without a value left out" if trend.history.broken else "",
        f"{trend.history.repeated} that are there twice left out" if trend.history.repeated else "",
        f"{trend.history.twins} of simulations left out (--machine)" if trend.history.twins else "",
        "served simulations of any seed count as one machine" if first.machine == "served" else "",
    ]
    return of, "; ".join(x for x in (span, *left) if x)


def _change(s: Segment, step: Step | None, position: int, t: Told) -> str:
    changed = f": new {', '.join(s.changed)}" if s.changed else ""
    by = (
        ""
        if step is None
        else f"; mean {_signed(step.change, t, 1)} ± {t.with_unit(step.half, 1)} against segment {(s.against or 0) + 1}"
    )
    return f"segment {position + 1}{changed}{by}"


def _rows(s: Segment, t: Told) -> Iterator[str]:
    unit = f", {t.unit}" if t.unit else ""
    yield _row("no", "visit" if t.axis == "visit" else "date, UTC", f"value{unit}", "U", "EWMA", _heading(s), "")
    for k, marks in enumerate(_marks(s)):
        if s.chart is not None and k == s.chart.baseline:
            yield _row("", "", "", "", "", f"{'-' * STRIP}", "")
        yield _line(s, k, t, marks)


def _row(number: str, when: str, value: str, u: str, ewma: str, strip: str, marks: str) -> str:
    return f"{number:>3} {when:<16} {value:>11} {u:>9} {ewma:>9} {strip:<{STRIP}} {marks}".rstrip()


def _line(s: Segment, k: int, t: Told, marks: str) -> str:
    averaged = None if s.chart is None or k < s.chart.baseline else float(s.chart.ewma[k - s.chart.baseline])
    when = t.when(float(s.times[k])).removeprefix("visit ")
    value, u, ewma = (_fitting(x, t, n) for x, n in ((s.results[k].value, 11), (s.results[k].U, 9), (averaged, 9)))
    return _row(str(k + 1), when, value, u, ewma, _strip(s, float(s.values[k]), averaged), marks)


def _fitting(x: float | None, t: Told, width: int) -> str:
    """A number in its column; one that is far larger than the others by its power of ten."""
    number = t.number(x)
    return number if x is None or len(number) <= width else f"{x / t.one / 10.0**t.power:.2g}"


def _marks(s: Segment) -> list[str]:
    """Of each run what marks it."""
    told = {"x": s.beyond, "e": s.ewma_beyond, "w": [] if all(s.wide) else s.wide, "d": s.overdue,
            "F": [r.outcome == "FAIL" for r in s.results], "?": [r.outcome == "INDETERMINATE" for r in s.results]}  # fmt: skip
    return ["".join(mark for mark, said in told.items() if said and said[k]) for k in range(len(s.results))]


def _heading(s: Segment) -> str:
    return "" if s.chart is None else f"{'-limit':>{STRIP // 2 - LIMIT + 4}}{'mean':^{2 * LIMIT - 5}}{'+limit'}"


def _strip(s: Segment, value: float, averaged: float | None) -> str:
    """Limits `|`, centre `:`, EWMA `~` and value `o` side by side; what lies farther off stands at the end as `<` or `>`."""
    middle = STRIP // 2
    cells = [" "] * STRIP
    if s.chart is not None:
        centre, half = s.chart.limits.centre, s.chart.limits.half
        cells[middle - LIMIT] = cells[middle + LIMIT] = "|"
    else:
        centre, half = float(s.values.mean()), float(abs(s.values - s.values.mean()).max())
    cells[middle] = ":"
    for mark, x in (("~", averaged), ("o", value)):
        if x is not None:
            off = round(LIMIT * (x - centre) / half) if half > 0 else 0
            inside = abs(off) <= middle
            cells[middle + max(-middle, min(middle, off))] = mark if inside else "<" if off < 0 else ">"
    return "".join(cells)


def _said(s: Segment, t: Told, weight: float) -> Iterator[str]:
    """What a segment shows, a sentence each."""
    if s.chart is None:
        yield f"limits: none; they take a baseline of 8 runs or more of one segment, found {len(s.results)}"
    else:
        limits = s.chart.limits
        yield (f"limits: {t.with_unit(limits.centre)} ± {t.with_unit(limits.half)}, three standard deviations by the moving "
               f"range of the first {s.chart.baseline} runs")  # fmt: skip
        if inside := list(_disturbed(s, s.chart.baseline)):
            yield f"in the baseline {', '.join(inside)}: the limits are as wide as that made them"
        if all(s.wide):
            yield ("U is wider than the limits in every run: what the runs have in common does not scatter, and the chart says "
                   "nothing of it")  # fmt: skip
        for signal in s.signals:
            yield _signal(signal, s, t, weight)
        if not s.signals and len(s.results) > s.chart.baseline:
            yield f"no signal in the {len(s.results) - s.chart.baseline} runs since"
    yield from _drift(s, t)
    yield from _overdue(s)


def _overdue(s: Segment) -> Iterator[str]:
    """Certificates that were past their due dates, each with the number of runs that rest on it."""
    late = Counter(key for r in s.results for key in filter(None, (r.overdue or "").split(", ")))
    for key, runs in late.items():
        yield (f"certificate {key} was past its due date in {runs} of {len(s.results)} runs: a change of it since it was "
               "issued is in no U")  # fmt: skip


def _disturbed(s: Segment, baseline: int) -> Iterator[str]:
    """Runs of the baseline that show no undisturbed machine: beyond the limits that they helped to make, or in doubt."""
    for k, (result, beyond) in enumerate(zip(s.results[:baseline], s.beyond, strict=False)):
        if beyond:
            yield f"run {k + 1} lies beyond them"
        elif result.outcome == "INDETERMINATE":
            yield f"run {k + 1} ended INDETERMINATE"


def _signal(g: Signal, s: Segment, t: Told, weight: float) -> str:
    baseline = s.chart.baseline if s.chart is not None else 0
    way = "above" if g.upward else "below"
    shown = f"{g.chart}: {way} its limits first in run {g.at + 1} ({s.results[g.at].run_id})"
    began = f"; the change began about run {g.began + 1} (CUSUM)"
    watched = len(s.results) - baseline
    if watched > CHANCES:
        return shown + began
    left = no_signal(repeat(0.0, watched), 1.0 if g.chart == "individuals" else weight, baseline)[-1]
    share = f"Of machines that do not change {100 * (1 - left):.0f} %"
    return f"{shown}{began}. {share} show one in this chart by now, with limits from {baseline} runs"


def _drift(s: Segment, t: Told) -> Iterator[str]:
    d = s.drift
    if d is None:
        yield f"drift: not known; it takes three runs at different times, found {len(s.results)}"
        return
    slope, half = t.slope(d.slope), t.slope(d.half)
    finer = _digits(half, t)
    shown = "" if d.shown else ": no drift is shown"
    yield (f"drift: {_signed(slope, t, finer)} ± {t.with_unit(half, finer)} per {t.per} (95 %){shown}; scatter about it "
           f"{t.with_unit(d.scatter, 1)}, {d.dof} degree{'s' if d.dof > 1 else ''} of freedom")  # fmt: skip
    if s.excess is not None:
        yield (f"the runs scatter {s.excess:.2g} times as much as their own uncertainties can explain: something moves them "
               "that no budget has")  # fmt: skip
    yield from _advice(s, t)


def _advice(s: Segment, t: Told) -> Iterator[str]:
    """When the drift's band reaches the limits."""
    found = reaches(s)
    far = [r for r in found if r.time is None]
    if found and len(far) == len(found):
        ends = " nor ".join(_limit(r, t) for r in far)
        none = "reaches neither" if len(far) == 2 else "does not reach"
        yield f"the drift's 95 % band {none} {ends} until {t.day(far[0].asked)}, {FARTHEST:g} times the time observed"
    for r in found:
        if r.time is not None and r.time <= s.times[-1]:
            yield f"the drift's 95 % band has reached {_limit(r, t)}, by the last run"
        elif r.time is not None:
            yield (f"the drift's 95 % band reaches {_limit(r, t)}, on {t.day(r.time)}: advice (ILAC-G24, method 2), not a due "
                   "date")  # fmt: skip


def _limit(r: Reach, t: Told) -> str:
    unit = "" if t.symbol == "1" else f" {t.symbol}"
    return f"the {'upper' if r.upward else 'lower'} limit {r.limit / t.one:.6g}{unit}"


def _digits(half: float, t: Told) -> int:
    """How many digits finer than values a slope is told: two of its interval."""
    if half <= 0:
        return 0
    return max(0, t.place - (int(f"{half / t.one:.1e}".partition("e")[2]) - 1))


def _signed(value: float, t: Told, finer: int = 0) -> str:
    number = t.number(value, finer)
    return number if number.startswith("-") else f"+{number}"


def _folded(said: str, indent: int) -> list[str]:
    return textwrap.wrap(said, WIDTH, initial_indent=" " * indent, subsequent_indent=" " * (indent + 2 * bool(indent)),
                         break_long_words=False, break_on_hyphens=False)  # fmt: skip
