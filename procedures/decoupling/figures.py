"""What is looked at: both axes over a period, the cross force over the moved axis' place."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from bench.rigfile.stage import StageAxis
from procedures.decoupling.estimates import Result
from procedures.decoupling.plan import Plan

Array = npt.NDArray[np.float64]
POINTS = 1000  # of a curve


def all_figures(results: Sequence[Result], plan: Plan) -> Iterator[Figure]:
    """Two of each pair, traces first."""
    yield from (_traces(r, plan) for r in results)
    yield from (_forces(r) for r in results)


def _told(axis: StageAxis, *, small: bool) -> tuple[float, str]:
    if axis.unit == "rad":
        return 180 / math.pi, "°"
    return (1e6, "µm") if small else (1e3, "mm")


def _traces(r: Result, plan: Plan) -> Figure:
    every = max(r.place.shape[1] // POINTS, 1)
    t = np.arange(r.place.shape[1]) * plan.period_s / r.place.shape[1]
    (big, unit), (fine, small) = _told(r.pair.moved, small=False), _told(r.pair.held, small=True)
    low, high = r.place.min(axis=0), r.place.max(axis=0)
    held = (
        Series("", t[::every], fine * _extremes(low, every, np.minimum), "faint"),
        Series("", t[::every], fine * _extremes(high, every, np.maximum), "faint"),
        Series("", t[::every], fine * r.place.mean(axis=0)[::every]),
    )
    below = Figure("", "", "", "time / s", f"{r.pair.held.name} less its set point / {small}", held, lines=(("", 0.0),))
    told = small if small == "°" else f" {small}"
    caption = (f"{r.pair.moved.name} follows its sine, {r.pair.held.name} is held: readings over a period, {len(r.place)} "
               f"periods laid on each other; below their mean, in grey their least and greatest, and the set point. The "
               f"largest excursion is {fine * r.excursion:.3g}{told}.")  # fmt: skip
    moved = Series(r.pair.moved.name, t[::every], big * r.moved.mean(axis=0)[::every])
    key = f"traces-{r.pair.held.name}-{r.pair.moved.name}"
    return Figure(key, f"Both axes over a period: {r.pair.where}", caption, "time / s", f"{r.pair.moved.name} / {unit}",
                  (moved,), below=below)  # fmt: skip


def _extremes(x: Array, every: int, of: np.ufunc) -> Array:
    """Of each stretch, so that no single reading is left out of a curve."""
    out: Array = of.reduceat(x, np.arange(0, len(x), every))
    return out


def _forces(r: Result) -> Figure:
    scale, unit = _told(r.pair.moved, small=False)
    place, force, series = r.moved.mean(axis=0), 1e3 * r.cross.wave, []
    for way, name in ((1, "up"), (-1, "down")):
        some = np.flatnonzero(r.cross.on & (way * r.rate > 0))
        order = some[np.argsort(place[some])]
        series.append(Series(name, scale * place[order], force[order]))
    what = "torque" if r.pair.held.unit == "rad" else "force"
    caption = (f"What {r.pair.moved.name}'s motion puts on {r.pair.held.name}, by the {what} that its loop asks for against "
               "it, over the place of the moved axis, in the mean of the periods, where that axis slides; a constant is left "
               "out.")  # fmt: skip
    key = f"cross-{r.pair.held.name}-{r.pair.moved.name}"
    return Figure(key, f"Cross {what}: {r.pair.where}", caption, f"{r.pair.moved.name} / {unit}",
                  f"{what} on {r.pair.held.name} / m{r.pair.held.force}", tuple(series), lines=(("zero", 0.0),))  # fmt: skip
