"""What a force map draws: residuals over what was measured, and how the prediction improves with each term."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bench.figures import Figure, Series
from bench.uncertainty import coverage_factor
from procedures.estimators import map_estimates
from procedures.estimators.map_data import MapData
from procedures.estimators.map_estimates import Result
from procedures.estimators.mapping import Part

ROWS = {"force": ("F_x", "F_y"), "torque": ("torque",)}


def part_figures(parts: Sequence[Part]) -> list[Figure]:
    """Residuals and selection of each part."""
    return [figure for part in parts for figure in (residuals(part), *selection(part))]


def residuals(part: Part) -> Figure:
    """Measured less fitted over measured."""
    series = tuple(
        Series(label, part.measured[:, k], part.fit.residuals[:, k], "points")
        for k, label in enumerate(ROWS[part.name])
    )
    return Figure(f"residuals-{part.name}", f"Residuals of the {part.name} model",
                  f"Value of the table less that of the model with {_listed(part.fit.terms)}; a pattern would point to a "
                  "term that is missing.", f"value of the table ({part.unit})", f"residual ({part.unit})", series,
                  lines=(("zero", 0.0),))  # fmt: skip


def selection(part: Part) -> list[Figure]:
    """Prediction error of points left out, over the number of terms; none where no point could be spared."""
    path = part.selection.path
    if not path or part.selection.chosen is None:
        return []
    size = np.array([float(len(c.terms)) for c in path])
    loss = np.log10([c.loss for c in path]) / 2
    chosen = part.selection.chosen
    return [
        Figure(f"selection-{part.name}", f"Terms of the {part.name} model",
               "Root mean square error in predicting a point from the others, for the best model of each size; chosen is the "
               "smallest that is not worse than the best by more than one standard error.",
               "number of terms", f"log10 of prediction error ({part.unit})",
               (Series("best of its size", size, loss, "both"),
                Series("chosen", np.array([float(len(chosen.terms))]), np.array([np.log10(chosen.loss) / 2]), "points")))
    ]  # fmt: skip


def _listed(terms: Sequence[str]) -> str:
    kind = terms[0].partition("_")[0]
    return f"{kind} " + ", ".join(t.partition("_")[2] for t in terms)


def rig_figures(data: MapData, result: Result) -> list[Figure]:
    """Residuals by load, the selection, and constants over their uncertainties."""
    fitted = result.force - result.residuals
    where = np.array(data.loads)[data.group]
    clouds = tuple(
        Series(load or "no load", fitted[where == load], result.residuals[where == load], "points")
        for load in dict.fromkeys(data.loads)
    )
    out = [
        Figure("residuals", "Residuals of the force map", "Vertical force of the motor, from the inboard AMB, less the model "
               "with every term that can be told; means of each angle and load taken off.", "force (N)", "residual (N)", clouds,
               lines=(("zero", 0.0),))
    ]  # fmt: skip
    if path := result.selection.path:
        size, loss = np.array([float(len(c.terms)) for c in path]), np.array([np.log10(c.loss) / 2 for c in path])
        out.append(Figure("selection", "Terms that the rig shows", "Root mean square error in predicting a point from the "
                          "others, for the best model of each size.", "number of terms", "log10 of prediction error (N)",
                          (Series("best of its size", size, loss, "both"),)))  # fmt: skip
    k = coverage_factor(max(len(result.residuals) - len(result.terms), 1))
    shown = [n for n in result.terms if n not in map_estimates.QUADRATURE]
    number = np.array([float(map_estimates.TERMS.index(n) + 1) for n in shown])
    ratio = [abs(e.value) / max(k * e.u, 1e-300) for e in (result.estimates[n] for n in shown)]
    out.append(Figure("resolved", "How well each term is told", "Constant over its expanded uncertainty (95 %), as a power of "
                      "ten; below nought the interval holds zero. 1 to 9 are terms of (5.25), 10 the cross force.", "term",
                      "log10 of value over U", (Series("terms", number, np.log10(np.maximum(ratio, 1e-2)), "points"),),
                      lines=(("U", 0.0),)))  # fmt: skip
    return out
