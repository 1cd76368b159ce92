"""What moves draw: of each coil, and of each repeat, the flux as a share of its motor's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.figures import Figure, Series
from procedures.emf_constant.estimates import Result


def all_figures(results: Sequence[Result]) -> Iterator[Figure]:
    """Repeats of all motors together, then coils."""
    yield _repeats(results)
    yield _coils(results)


def _repeats(results: Sequence[Result]) -> Figure:
    series = []
    for r in results:
        size = np.array([f.size for f in r.repeats])
        series.append(Series(r.winding.motor, np.arange(1.0, len(size) + 1), size / size.mean(), "points"))
    caption = "Flux of each repeat, there and back, as a share of the mean of all: what noise does to it."
    return Figure("repeats", "Flux by repeat", caption, "repeat", "flux, share of the mean", tuple(series),
                  lines=(("mean", 1.0),))  # fmt: skip


def _coils(results: Sequence[Result]) -> Figure:
    series, first = [], 1.0
    for r in results:
        each = r.by_coil / np.mean([f.size for f in r.repeats])
        n, coils = each.shape
        at = np.arange(first, first + coils)
        series.append(
            Series(r.winding.motor, at, each.mean(axis=0), "points", 2 * each.std(axis=0, ddof=1) / np.sqrt(n))
        )
        first += coils
    caption = ("Flux that each coil's voltage shows, as a share of its motor's; bars are two standard uncertainties by the "
               "repeats. Gains of the voltages' sensors are in it, which the mean of a motor averages.")  # fmt: skip
    return Figure("coils", "Flux by coil", caption, "coil, in the rig file's order", "flux, share of its motor's",
                  tuple(series), lines=(("alike", 1.0),))  # fmt: skip
