"""What the lines draw: at each frequency the constant that a mass alone would have, with the fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.figures import Figure, Series
from procedures.actuator_constant.estimates import Result

POINTS = 200


def all_figures(results: Sequence[Result]) -> Iterator[Figure]:
    """One of each loop."""
    yield from (_figure(r) for r in results if r.looked)


def _figure(r: Result) -> Figure:
    """|x/i| w^2 over what it is of a mass without anything else, K/M: the slope of cogging bends it at low frequencies."""
    series = []
    for x in r.looked:
        hz, size = np.array([one.hz for one in x.lines]), np.array([abs(one.ratio) for one in x.lines])
        u = np.array([one.u for one in x.lines])
        value = (2 * np.pi * hz) ** 2 * x.response.inertial / size
        grid = np.geomspace(hz.min(), hz.max(), POINTS)
        fitted = (2 * np.pi * grid) ** 2 * x.response.inertial / np.abs(x.response.at(grid))
        series.append(Series(f"{x.place.name}, measured", hz, value, "points", 2 * u / size * value))
        series.append(Series(f"{x.place.name}, fit", grid, fitted))
    caption = ("Position over current times the square of the frequency, as a share of K over the inertia: 1 where nothing "
               "but the inertia answers. Cogging's slope is what bends it at low frequencies.")  # fmt: skip
    return Figure(f"constant-{r.loop}", f"Answer to the current: {r.loop}", caption, "frequency (Hz)", "|x ω²/i| M/K",
                  tuple(series), lines=(("inertia alone", 1.0),), log_x=True)  # fmt: skip
