"""What the force-coupling run draws: currents over the phase angle with the model, and what the model leaves."""

from __future__ import annotations

import numpy as np

from bench.figures import Figure, Series
from procedures.estimators.carried_data import StepMeans
from procedures.estimators.coupling import currents
from procedures.estimators.coupling_estimates import Analysis


def all_figures(data: StepMeans, a: Analysis, pole_pairs: float) -> list[Figure]:
    """In the order of the report."""
    gamma, up = data.labels["gamma_rad"], data.labels["branch"] > 0
    degrees = np.degrees(gamma)
    grid = np.linspace(gamma.min(), gamma.max(), 121)
    x, y = currents(grid, a.fit.fit.terms, pole_pairs)
    straight = np.array([a.printed**-1, 1.0, 0.0, *a.fit.fit.terms[3:5]])
    xt, yt = currents(grid, straight, pole_pairs)
    n = len(data)
    left = 1e3 * a.fit.fit.residuals
    turned = np.degrees(np.arctan2(a.fit.i_x, a.fit.i_y))
    model_turn = np.degrees(np.arctan2(x, y))
    return [
        Figure("currents", "Motor currents over the phase angle",
               "Currents that hold the outboard end at the sensors' zero. Gravity asks for i_y; with the phase angle the "
               "force turns and i_x with it. Beside it what T (6.15) makes of the data, with the zero at 0.",
               "gamma (degrees)", "current (A)",
               (Series("i_y", degrees, a.fit.i_y, "points"), Series("i_y model", np.degrees(grid), y, "line"),
                Series("i_x", degrees, a.fit.i_x, "points"), Series("i_x model", np.degrees(grid), x, "line"),
                Series("i_y as T (6.15)", np.degrees(grid), yt, "line"),
                Series("i_x as T (6.15)", np.degrees(grid), xt, "line"))),
        Figure("turn", "How far the current turns",
               "Direction of the current vector; its slope at the zero is M alpha_c/alpha_d.",
               "gamma (degrees)", "direction of the current (degrees)",
               (Series("measured", degrees, turned, "points"), Series("model", np.degrees(grid), model_turn, "line"))),
        Figure("residuals", "Residuals over the phase angle",
               "Current measured less current modelled. A pattern would be a model that does not describe the machine.",
               "gamma (degrees)", "residual (mA)",
               tuple(Series(f"{name} {way}", degrees[use], part[use], "points")
                     for name, part in (("i_x", left[:n]), ("i_y", left[n:])) for way, use in (("up", up), ("down", ~up))),
               lines=(("zero", 0.0),)),
    ]  # fmt: skip
