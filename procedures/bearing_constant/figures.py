"""What the constants draw: the current that carries each weight, plane by plane."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.figures import Figure, Series
from procedures.bearing_constant.estimates import Result


def all_figures(r: Result) -> Iterator[Figure]:
    """A figure of each plane."""
    for plane, a in zip(r.planes, r.answers, strict=True):
        series = []
        for j, hook in enumerate(r.hooks):
            some = [k for k, v in enumerate(r.visits) if not v.load or v.hook == hook]
            x = np.array([r.visits[k].newtons for k in some])
            ends = np.array([0.0, x.max()])
            series += [
                Series(f"on {hook}", x, a.along[some], "points"),
                Series(f"line, {hook}", ends, a.rates[j] * ends),
            ]
        caption = (f"Mean current of {plane.motor} along the force, less what flows with nothing hung, over the weight on the "
                   "mover; a visit is a point.")  # fmt: skip
        yield Figure(f"weights-{plane.motor}", f"Weights carried by {plane.motor}", caption, "weight (N)",
                     "current (A)", tuple(series))  # fmt: skip
