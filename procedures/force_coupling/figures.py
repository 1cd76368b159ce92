"""What the force-coupling run draws: currents over the phase angle with the model, and what the model leaves."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from procedures.force_coupling.estimates import Analysis
from procedures.force_coupling.fit import currents
from procedures.force_coupling.steps import Phase
from procedures.shared.step_table import StepTable

Array = npt.NDArray[np.float64]


def all_figures(data: StepTable[Phase], a: Analysis, pole_pairs: float) -> list[Figure]:
    """In the order of the report."""
    gamma, up = data.each(lambda step: step.gamma_rad), data.each(lambda step: step.branch) > 0
    degrees = np.degrees(gamma)
    grid = np.linspace(gamma.min(), gamma.max(), 121)
    x, y = currents(grid, a.fit.fit.terms, pole_pairs)
    xt, yt = currents(gamma, _as_printed(gamma, a, pole_pairs), pole_pairs)
    n = len(data)
    left = 1e3 * a.fit.fit.residuals
    turned = np.degrees(np.arctan2(a.fit.i_x, a.fit.i_y))
    model_turn = np.degrees(np.arctan2(x, y))
    return [
        Figure("currents", "Motor currents over the phase angle",
               "Currents that hold the outboard end at the sensors' zero. Gravity asks for i_y; with the phase angle the "
               "force turns and i_x with it.",
               "phase angle (°)", "current (A)",
               (Series("i_y", degrees, a.fit.i_y, "points"), Series("i_y model", np.degrees(grid), y, "line"),
                Series("i_x", degrees, a.fit.i_x, "points"), Series("i_x model", np.degrees(grid), x, "line"))),
        Figure("turn", "How far the current turns",
               "Direction of the current vector; its slope at the zero is M alpha_c/alpha_d.",
               "phase angle (°)", "direction of the current (°)",
               (Series("measured", degrees, turned, "points"), Series("model", np.degrees(grid), model_turn, "line"))),
        Figure("residuals", "Residuals over the phase angle",
               "Current measured less current modelled. A pattern would be a model that does not describe the machine.",
               "phase angle (°)", "residual (mA)",
               tuple(Series(f"{name} {way}", degrees[use], part[use], "points")
                     for name, part in (("i_y", left[n:]), ("i_x", left[:n])) for way, use in (("up", up), ("down", ~up))),
               lines=(("zero", 0.0),)),
        Figure("residuals-as-printed", "Residuals of the thesis' own fit",
               f"The same with the linear fit of T (6.15), gamma_0 = 0: alpha_d/alpha_c = {a.printed:.4f} instead of "
               f"{a.fit.term('r'):.4f}. The pattern is the zero of the commutation, {np.degrees(a.fit.term('gamma_0')):+.3f}°.",
               "phase angle (°)", "residual (mA)",
               (Series("i_y", degrees, 1e3 * (a.fit.i_y - yt), "points"),
                Series("i_x", degrees, 1e3 * (a.fit.i_x - xt), "points")),
               lines=(("zero", 0.0),)),
    ]  # fmt: skip


def _as_printed(gamma: Array, a: Analysis, pole_pairs: float) -> Array:
    """Terms of the model as T (6.15) has it: its ratio, the zero at 0, equal windings, forces from the means."""
    c, q = np.cos(pole_pairs * gamma), np.sin(pole_pairs * gamma) / a.printed
    f_x, f_y = -np.mean(c * a.fit.i_x - q * a.fit.i_y), -np.mean(c * a.fit.i_y + q * a.fit.i_x)
    return np.array([1 / a.printed, 1.0, 0.0, f_x, f_y, 0.0, 0.0])
