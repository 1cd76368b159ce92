"""What turns with the shaft, drawn as it points where the angle reads zero."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.figures import Figure, Series
from procedures.runout_map.estimates import Results, mean


def all_figures(r: Results) -> Iterator[Figure]:
    """One of all planes and places."""
    if r.seen:
        yield _figure(r)


def _figure(r: Results) -> Figure:
    series, notes = [], []
    for name in dict.fromkeys(s.plane.name for s in r.seen):
        some = [s for s in r.seen if s.plane.name == name]
        v = 1e6 * np.array([mean(s.whole, s.signs) for s in some])
        each = 1e6 * np.array([x for s in some for x in s.whole])
        series.append(Series(name, v.real, v.imag, "both"))
        series.append(Series(f"{name}, each turn", each.real, each.imag, "points"))
        notes += [(s.place, float(x.real), float(x.imag)) for s, x in zip(some, v, strict=True)]
    caption = ("Runout of the target less that of the magnets, as it points where the angle reads zero: by the currents that "
               "turn with the shaft while the loops hold the readings, and by what they leave of these. Neither of both "
               "alone.")  # fmt: skip
    return Figure("runout", "Runout of target and magnets", caption, "x (µm)", "y (µm)", tuple(series), kind="plane",
                  notes=tuple(notes))  # fmt: skip
