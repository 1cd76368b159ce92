"""What a force map draws: its greatest terms, residuals, and how the prediction improves with each term."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from procedures.force_map.estimates import Result
from procedures.force_map.steps import MapData
from procedures.force_map.terms import Part

Array = npt.NDArray[np.float64]
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
    loss = np.sqrt([c.loss for c in path])
    chosen = part.selection.chosen
    return [
        Figure(f"selection-{part.name}", f"Terms of the {part.name} model",
               "Root mean square error in predicting a point from the others, for the best model of each size; chosen is the "
               "smallest that is not worse than the best by more than one standard error.",
               "number of terms", f"prediction error ({part.unit})",
               (Series("best of its size", size, loss, "both"),
                Series("chosen", np.array([float(len(chosen.terms))]), np.array([math.sqrt(chosen.loss)]), "points")),
               log_y=True)
    ]  # fmt: skip


def _listed(terms: Sequence[str]) -> str:
    kind = terms[0].partition("_")[0]
    return f"{kind} " + ", ".join(t.partition("_")[2] for t in terms)


def rig_figures(data: MapData, result: Result) -> list[Figure]:
    """Force over current and over displacement, residuals by load, and the selection."""
    fitted = result.force - result.residuals
    where = np.array(data.loads)[data.group]
    loads = {load: where == load for load in dict.fromkeys(data.loads)}
    clouds = tuple(Series(load or "no load", fitted[m], result.residuals[m], "points") for load, m in loads.items())
    points = result.points
    out = [
        *_share(result, "alpha_1", points.i_y, 1.0, "current", "motor current i_y (A)", loads),
        *_share(result, "alpha_5", points.y, 1e6, "displacement", "displacement y at the motor (µm)", loads),
        Figure("residuals", "Residuals of the force map", "Vertical force of the motor, from the inboard AMB, less the model "
               "with every term that can be told; means of each angle and load taken off.", "force (N)", "residual (N)", clouds,
               lines=(("zero", 0.0),)),
    ]  # fmt: skip
    if path := result.selection.path:
        size, loss = np.array([float(len(c.terms)) for c in path]), np.array([math.sqrt(c.loss) for c in path])
        out.append(Figure("selection", "Terms that the rig shows", "Root mean square error in predicting a point from the "
                          "others, for the best model of each size.", "number of terms", "prediction error (N)",
                          (Series("best of its size", size, loss, "both"),), log_y=True))  # fmt: skip
    return out


def _share(
    result: Result, term: str, over: Array, scale: float, name: str, label: str, loads: Mapping[str, npt.NDArray[np.bool_]]
) -> Iterator[Figure]:  # fmt: skip
    """What one term makes of the force, with what the whole model leaves: its line, and the points about it."""
    if term not in result.estimates:
        return
    slope = result.estimates[term].value
    own = slope * over + result.residuals
    ends = np.array([over.min(), over.max()])
    yield Figure(f"force-{name}", f"Vertical force of the motor over its {name}", "All points, freed of the model's other "
                 "terms; what is left of them about the line is drawn apart.", label, "force (N)",
                 (*(Series(load or "no load", scale * over[m], own[m], "points") for load, m in loads.items()),
                  Series("by the force map", scale * ends, slope * ends)))  # fmt: skip
