"""What the lines draw: at each frequency the constant that a mass alone would have, with the fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.figures import Figure, Series
from procedures.actuator_constant.estimates import Looked, Result

POINTS = 200


def all_figures(results: Sequence[Result]) -> Iterator[Figure]:
    """One of each loop, and one of what turns with the ring on."""
    yield from (_figure(r) for r in results if r.looked)
    yield from (_ringed(r) for r in results if r.ringed)


def _figure(r: Result) -> Figure:
    """|x/i| w^2 over what it is of a mass without anything else, K/M: the slope of cogging bends it at low frequencies."""
    series = [one for x in r.looked for one in _series(x, x.response.inertial)]
    caption = ("Position over current times the square of the frequency, as a share of K over the inertia: 1 where nothing "
               "but the inertia answers. Cogging's slope is what bends it at low frequencies.")  # fmt: skip
    return Figure(f"constant-{r.loop}", f"Answer to the current: {r.loop}", caption, "frequency (Hz)", "|x ω²/i| M/K",
                  tuple(series), lines=(("inertia alone", 1.0),), log_x=True)  # fmt: skip


def _ringed(r: Result) -> Figure:
    """Of what it is without the ring, J/(J + J_r)."""
    inertial = [x.response.inertial for x in r.looked]
    pairs = [(x, own) for some in (r.looked, r.ringed) for x, own in zip(some, inertial, strict=True)]
    series = [one for x, own in pairs for one in _series(x, own)]
    share = sum(inertial) / sum(x.response.inertial for x in r.ringed)
    caption = ("The same with and without the ring, as a share of K over the inertia without it: the ring takes it down to the "
               "share that the mover has of both inertias.")  # fmt: skip
    return Figure(f"constant-{r.loop}-ring", f"Answer to the current with and without the ring: {r.loop}", caption,
                  "frequency (Hz)", "|x ω²/i| J/K", tuple(series),
                  lines=(("mover alone", 1.0), ("mover and ring", share)), log_x=True)  # fmt: skip


def _series(x: Looked, inertial: float) -> list[Series]:
    hz, size = np.array([one.hz for one in x.lines]), np.array([abs(one.ratio) for one in x.lines])
    u = np.array([one.u for one in x.lines])
    value = (2 * np.pi * hz) ** 2 * inertial / size
    grid = np.geomspace(hz.min(), hz.max(), POINTS)
    fitted = (2 * np.pi * grid) ** 2 * inertial / np.abs(x.response.at(grid))
    return [Series(f"{x.place.name}, measured", hz, value, "points", 2 * u / size * value),
            Series(f"{x.place.name}, fit", grid, fitted)]  # fmt: skip
