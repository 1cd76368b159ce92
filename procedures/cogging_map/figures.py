"""What sweeps draw: force over the place, either way, with the fitted harmonics."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.figures import Figure, Series
from bench.rigfile import RigFile
from procedures.cogging_map.estimates import Result
from procedures.position_loops.motors import around

POINTS, BINS, PERIODS = 400, 72, 2


def all_figures(results: Sequence[Result], rig: RigFile) -> Iterator[Figure]:
    """One of each loop."""
    yield from (_figure(r, around(rig, r.map.loop)) for r in results)


def _figure(r: Result, turns: bool) -> Figure:
    """Means over bins of place, all periods of the map laid on the first ones."""
    scale, unit = (180 / math.pi, "°") if turns else (1e3, "mm")
    gives = r.known.together.value
    shown = r.map.length * min(PERIODS, r.map.first) / r.map.first
    series = []
    for sign, name in ((1, "up"), (-1, "down")):
        some = [p for p in r.passes if p.sign == sign and p.fed]
        at = np.concatenate([np.mod(p.position - r.map.low, shown) for p in some])
        current = np.concatenate([np.mean(list(p.currents.values()), axis=0) for p in some])
        where = np.minimum((at / shown * BINS).astype(int), BINS - 1)
        count = np.maximum(np.bincount(where, minlength=BINS), 1)
        x, y = (np.bincount(where, v, BINS) / count for v in (at, current))
        series.append(Series(name, scale * (r.map.low + x), gives * y, "points"))
    grid = r.map.low + np.linspace(0, shown, POINTS)
    phase = 2 * math.pi * r.map.turns / r.map.length * grid
    constant = np.mean([s.constant for s in r.swept])
    series.append(Series("first and second harmonic", scale * grid, gives * (constant + r.shape.at(phase))))
    what, per = ("torque", "N m") if turns else ("force", "N")
    caption = (f"What takes cogging off, by the currents and the constants: means over places of sweeps with feedforward, "
               f"the whole map laid on {shown * scale:.4g} {unit}. Up and down differ by friction alone.")  # fmt: skip
    return Figure(f"cogging-{r.map.loop}", f"Cogging: {r.map.loop}", caption, f"{r.map.loop} ({unit})", f"{what} ({per})",
                  tuple(series), lines=(("zero", 0.0),))  # fmt: skip
