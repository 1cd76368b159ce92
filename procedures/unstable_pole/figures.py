"""What shots draw: readings with their fit and what is left of it, of each axis; how far shots went."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from bench.figures import Figure, Series
from procedures.unstable_pole.estimates import Result

SHOWN = 6  # shots of an axis, among those pushed along it


def all_figures(results: Sequence[Result]) -> Iterable[Figure]:
    """Of each axis its shots in time, then what their noise is beside."""
    for result in results:
        yield _shots(result)


def _shots(result: Result) -> Figure:
    series: list[Series] = []
    left: list[Series] = []
    some = [k for k, t in enumerate(result.shots) if t.axis == result.axis][:SHOWN]
    for k in some:
        t, curve = result.shots[k], result.release.curves[k]
        ms = np.arange(len(curve), dtype=np.float64) * (t.step_s * 1e3)
        z = t.z[result.axis] * 1e6
        names = (
            ("", "", "") if series else ("mean of both planes, each shot", "its fit", "half their difference, fitted")
        )
        series += [Series(names[0], ms, z[:, 0], "points"), Series(names[1], ms, curve[:, 0] * 1e6, "guide"),
                   Series(names[2], ms, curve[:, 1] * 1e6, "faint")]  # fmt: skip
        left.append(Series("", ms, z[:, 0] - curve[:, 0] * 1e6, "faint"))
    below = Figure(f"left-{result.axis}", "", "", "time / ms", "left / µm", tuple(left))
    pole = result.estimates["pole"].value
    caption = (
        f"The first {len(some)} of the shots that were pushed along {result.axis}, from where the currents have come to rest: "
        f"mean of both planes' readings and the fit of all shots (pole {pole:.1f} 1/s), thin how it tilts (half the planes' "
        "difference). Below, what the fit leaves of the mean."
    )
    return Figure(f"shots-{result.axis}", f"Shots along {result.axis}", caption, "time / ms", f"{result.axis} / µm",
                  tuple(series), below=below)  # fmt: skip
