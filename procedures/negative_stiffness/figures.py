"""What the negative-stiffness run draws: current over displacement, the AMB's forces at two biases, and both residuals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.figures import Figure, Series
from procedures.negative_stiffness.estimates import Analysis
from procedures.negative_stiffness.plan import Plan
from procedures.servomotor.conventions import Servomotor


def all_figures(a: Analysis, machine: Servomotor, plan: Plan) -> list[Figure]:
    """In the order of the report."""
    return [*_motor(a, machine), *_ambs(a, plan)]


def _motor(a: Analysis, machine: Servomotor) -> Iterator[Figure]:
    y, up = 1e6 * a.motor.mean[machine.positions["yo"]], a.motor.each(lambda step: step.branch) > 0
    i, n = a.by_motor.i_y, len(a.motor)
    slope, intercept = np.polyfit(y, i, 1)
    ends = np.array([y.min(), y.max()])
    line = Series(f"slope {slope * 1e3:.2f} mA/µm", ends, intercept + slope * ends, "line")
    yield Figure("current", "Current of the motor over displacement",
                 "Vertical motor current that holds the outboard end, the outboard AMB being off. At the top the magnets pull "
                 "up by themselves and the motor needs less.",
                 "outboard position (µm)", "motor current i_y (A)",
                 (line, Series("going up", y[up], i[up], "points"),
                  Series("going down", y[~up], i[~up], "points")))  # fmt: skip
    vertical, horizontal = 1e3 * a.by_motor.fit.residuals[:n], 1e3 * a.by_motor.fit.residuals[n:]
    yield Figure("current-residuals", "Residuals of the motor's forces",
                 f"What the fit leaves of the forces; the whole range is {np.ptp(a.by_motor.force):.1f} N.",
                 "outboard position (µm)", "residual (mN)",
                 (Series("vertical", y, vertical, "points"), Series("horizontal", y, horizontal, "points")),
                 lines=(("zero", 0.0),))  # fmt: skip


def _ambs(a: Analysis, plan: Plan) -> Iterator[Figure]:
    f = a.by_ambs
    y = 1e6 * f.y_o
    series, left = [], []
    for bias in (plan.bias_A, plan.bias_high_A):
        use = a.ambs.each(lambda step: step.bias_A) == bias
        order = np.argsort(y[use], kind="stable")
        zero = float(np.interp(0.0, y[use][order], f.force[use][order]))
        for force, what in ((f.force[use] - zero, "current alone"), (f.total[use] - zero, "in all")):
            slope = float(np.polyfit(y[use], force, 1)[0])
            series.append(Series(f"{bias:g} A, {what}: {slope:.3f} N/µm", y[use][order], force[order], "both"))
        left.append(Series(f"{bias:g} A", y[use], 1e3 * f.fit.residuals[use], "points"))
    yield Figure("two-biases", "Force of the outboard AMB over displacement at two biases",
                 "What the currents give at the centre (current alone) must also make up for the AMB's own position stiffness, "
                 "which grows with the square of the bias. Freed of that (in all), both show the same line: the motor's.",
                 "displacement at the outboard AMB (µm)", "change of force (N)", tuple(series))  # fmt: skip
    yield Figure("two-biases-residuals", "Residuals of the AMB's forces",
                 f"What the fit leaves of the moments, as force at the outboard AMB. Fitted gap {1e3 * f.gap_m:.4f} mm.",
                 "displacement at the outboard AMB (µm)", "residual (mN)", tuple(left), lines=(("zero", 0.0),))  # fmt: skip
