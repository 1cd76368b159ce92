"""What sines draw: by sine and repeat, what an axis moves by the map, bare and with the part."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.figures import Figure, Series
from procedures.axis_inertia.estimates import Result
from procedures.stages.spread import turns


def all_figures(r: Result) -> Iterator[Figure]:
    """Each axis."""
    for name in r.axes:
        yield _axis(r, name)


def _axis(r: Result, name: str) -> Figure:
    a, m, around = r.axes[name], r.moved[name], turns(r.of[name])
    scale, unit = (1e3, "g m²") if around else (1.0, "kg")
    series = []
    for k, on in enumerate(("bare", "with the part")):
        for tone in range(a.per.shape[2]):
            y = a.per[k, :, tone].mean(axis=1)
            at = np.arange(1.0, len(y) + 1)
            series.append(Series(f"{on}, sine {tone + 1}", at, scale * y, "points"))
    what = "moment of inertia" if around else "mass"
    caption = (f"By the controller's map, repeat by repeat: the map errs from place to place, alike with and without the part. "
               f"The line is the result, of which nothing of the map is left: {scale * m.inertia:.5g} {unit}.")  # fmt: skip
    return Figure(f"inertia-{name}", f"What {name} moves", caption, "repeat", f"{what} / {unit}", tuple(series),
                  lines=(("result", scale * m.inertia),))  # fmt: skip
