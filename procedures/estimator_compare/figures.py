"""What the comparison draws: answers to the switch and to the load beside each other, and the repeats of each quantity."""

from __future__ import annotations

import numpy as np

from bench.figures import Figure, Series
from procedures.estimator_compare import fit
from procedures.estimator_compare.estimates import Result
from procedures.estimator_compare.plan import Plan
from procedures.estimator_compare.requires import ENGAGE, HANG
from procedures.estimator_compare.steps import of_kind


def all_figures(result: Result, plan: Plan) -> list[Figure]:
    """In the order of the report."""
    return [_loaded(result, plan), _switched(result, plan), _repeats(result, plan)]


def _loaded(result: Result, plan: Plan) -> Figure:
    series = []
    for estimator in plan.loaded:
        t = of_kind(result.taken, HANG, estimator)[0]
        at = fit.moved_at(t.y, round(plan.lead_s / t.tick_s), t.tick_s)
        use = slice(max(at - 500, 0), at + 6000)
        time = np.asarray((np.arange(len(t.y)) - at) * t.tick_s * 1e3, np.float64)
        series.append(Series(estimator, time[use], 1e6 * (t.y - t.y[:at].mean())[use]))
    caption = "Position of the first repeat as the sensor reads it, from where it was."
    return Figure("load", "Answer to the load", caption, "time (ms)", "position (µm)", tuple(series))


def _switched(result: Result, plan: Plan) -> Figure:
    series = []
    for estimator in plan.engaged:
        t = of_kind(result.taken, ENGAGE, estimator)[0]
        at = fit.switched_at(t.current, t.y, t.v, t.disturbance, round(plan.lead_s / t.tick_s), t.tick_s)
        use = slice(max(at - 500, 0), at + 1100)
        time = np.asarray((np.arange(len(t.y)) - at) * t.tick_s * 1e3, np.float64)
        series.append(Series(estimator, time[use], 1e6 * t.y[use]))
    caption = "Position of the first repeat as the sensor reads it; judged is 50 to 100 ms after the switch."
    return Figure("switch", "Compensation switched on", caption, "time (ms)", "position (µm)", tuple(series))


def _repeats(result: Result, plan: Plan) -> Figure:
    by = result.values["velocity_error"]
    series = tuple(Series(e, np.arange(1.0, len(by[e]) + 1), 100 * by[e], "points") for e in plan.engaged)
    return Figure("repeats", "Velocity error of each repeat", "Before the switch, over the derivative's rms.", "repeat",
                  "velocity error (%)", series)  # fmt: skip
