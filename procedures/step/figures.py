"""What the set-point steps draw: the responses with band and model, the control current, the overshoot over the size."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from bench.figures import Figure, Series
from bench.uncertainty import coverage_factor
from procedures.step.estimates import Result
from procedures.step.oscillation import FROM_S
from procedures.step.response import trailing
from procedures.step.steps import Case, Done

SWING_S = 0.05
BEFORE_S = -4e-3
NEAR = 0.15  # of the step: what the settling is drawn of
ASIDE = 0.02  # of the largest step, between the settings' points


def all_figures(steps: Sequence[Done], results: Mapping[Case, Result]) -> list[Figure]:
    """In the order of the report: for each axis and speed the swing, the settling and the control current of the
    largest step."""
    out: list[Figure] = []
    largest = max(c.size for c in results)
    places = dict.fromkeys((c.axis, c.speed) for c in results)
    for axis, speed in places:
        cases = [c for c in results if (c.axis, c.speed, c.size, c.way) == (axis, speed, largest, 1)]
        first = [next(d for d in steps if d.case == c) for c in cases]
        out += [_swing(first, results), _settling(first, results), _control(first)]
    return [*out, *_sizes(results)]


def raw_figures(steps: Sequence[Done]) -> list[Figure]:
    """The first step of each axis and speed as it came, where the analysis goes no further."""
    first = {(d.case.axis, d.case.speed): d for d in reversed(steps)}
    return [
        Figure(f"raw-{_key(d.case)}", f"Position along and across, {_title(d.case)}", "As recorded, from where the "
                                                                                      "shaft rested.",
               "time (ms)", "position (µm)",
               (Series(d.case.axis, 1e3 * d.t, 1e6 * d.raw), Series("across", 1e3 * d.t, 1e6 * d.across)),
               lines=(("set point", 1e6 * d.case.size),))
        for d in first.values()
    ]  # fmt: skip


def _key(case: Case) -> str:
    return f"{case.axis}-{case.speed * 30 / math.pi:.0f}"


def _title(case: Case) -> str:
    return f"{case.size * 1e6:g} µm in {case.axis} at {case.speed * 30 / math.pi:.0f} r/min"


def _swing(done: Sequence[Done], results: Mapping[Case, Result]) -> Figure:
    series = []
    for d in done:
        near = (d.t > BEFORE_S) & (d.t < SWING_S)
        middle = d.t - (d.t[1] - d.t[0]) / 2
        series.append(Series(d.case.setting, 1e3 * middle[near], 1e6 * d.y[near], "points"))
        fitted = results[d.case].swing
        if fitted is not None:
            t = np.arange(FROM_S, SWING_S, 2e-4)
            series.append(Series(f"fit, {d.case.setting}", 1e3 * t, 1e6 * d.case.size * fitted.at(t)))
    size, apart = 1e6 * done[0].case.size, 1e3 * (done[0].t[1] - done[0].t[0])
    return Figure(f"swing-{_key(done[0].case)}", f"First swing, {_title(done[0].case)}",
                  f"Points: means over {apart:.3g} ms of one step, at their middles, without what turns with the shaft. Lines: "
                  "the oscillations fitted to all steps of this size and direction, whose top is the overshoot. Rise is "
                  "between the dashed levels of 10 and 90 %.",
                  "time since the set point acts (ms)", "position (µm)", tuple(series),
                  lines=(("set point", size), ("90 %", 0.9 * size), ("10 %", 0.1 * size)))  # fmt: skip


def _settling(done: Sequence[Done], results: Mapping[Case, Result]) -> Figure:
    """How far the averaged position is off, from where it is within NEAR of the step."""
    within = max(results[d.case].settled.within for d in done)
    settled = [results[d.case].settled.time for d in done]
    end = done[0].t[-1] if not all(map(math.isfinite, settled)) else min(max(3 * max(settled), 0.2), done[0].t[-1])
    series = []
    for d in done:
        off = trailing(d.y, d.samples) / d.case.size - 1
        far = np.flatnonzero((np.abs(off) > NEAR) & (d.t < 0.5 * d.t[-1]))
        m = (d.t > (d.t[far[-1]] if len(far) else 0)) & (d.t < end)
        series.append(Series(d.case.setting, 1e3 * d.t[m], 100 * off[m]))
    turn = "one revolution" if done[0].case.speed else "6 ms"
    return Figure(f"settling-{_key(done[0].case)}", f"Settling, {_title(done[0].case)}",
                  f"Position off its set point, averaged over {turn}, from where it is within {NEAR:.0%} of the step; "
                  f"the band is "
                  f"{within:.1%} on both sides. One step of each setting; the settling time is that of the mean of "
                  f"the repeats.",
                  "time since the set point acts (ms)", "off the set point (% of the step)", tuple(series),
                  lines=(("band, above", 100 * within), ("band, below", -100 * within)))  # fmt: skip


def _control(done: Sequence[Done]) -> Figure:
    series = tuple(
        Series(d.case.setting, 1e3 * d.t[m], d.control[m]) for d in done for m in [(d.t > BEFORE_S) & (d.t < SWING_S)]
    )
    bearings = " and ".join(done[0].machine.planes)
    which = f"{bearings} together" if done[0].case.axis != "x" else f"of {done[0].machine.axial}"
    return Figure(f"control-{_key(done[0].case)}", f"Control current, {_title(done[0].case)}",
                  f"Positive less negative coil, {which}, from where it rested. It says when the step began.",
                  "time since the set point acts (ms)", "current (A)", series)  # fmt: skip


def _sizes(results: Mapping[Case, Result]) -> Iterator[Figure]:
    """Overshoot over the signed size: a linear loop gives one level."""
    for axis, speed in dict.fromkeys((c.axis, c.speed) for c in results):
        series = []
        for k, setting in enumerate(dict.fromkeys(c.setting for c in results)):
            shift = k * ASIDE * max(c.size for c in results)
            cases = sorted(
                (
                    c
                    for c, r in results.items()
                    if (c.axis, c.speed, c.setting) == (axis, speed, setting) and "overshoot" in r.estimates
                ),
                key=lambda c: c.way * c.size,
            )
            found = [results[c].estimates["overshoot"] for c in cases]
            u = [100 * coverage_factor(len(results[c].ones) - 1) * e.u for c, e in zip(cases, found, strict=True)]
            x, y = (
                np.array(v) for v in ([1e6 * (c.way * c.size + shift) for c in cases], [100 * e.value for e in found])
            )
            series.append(Series(setting, x, y, "points", np.array(u)))
        title = f"Overshoot over the step in {axis} at {speed * 30 / math.pi:.0f} r/min"
        yield Figure(f"sizes-{axis}-{speed * 30 / math.pi:.0f}", title, "Mean of the repeats with its 95 % interval; "
                                                                        "a linear loop has "
                     "one overshoot for all sizes and both directions.", "step (µm)", "overshoot "
                                                                                      "(%)", tuple(series))  # fmt: skip
