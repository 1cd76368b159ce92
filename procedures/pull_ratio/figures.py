"""What the levels draw: of each loop the current that holds, over the place."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from bench.figures import Figure, Series
from bench.rigfile import RigFile
from procedures.pull_ratio.estimates import ALONG_WEIGHT, FREE, RATIO, Result, Slope
from procedures.pull_ratio.planes import BOTH, axes, upwards
from procedures.pull_ratio.steps import Array, Taken


def all_figures(r: Result, taken: Sequence[Taken], rig: RigFile) -> Iterable[Figure]:
    """One of each axis, both planes in it, then what is left of the lines."""
    for axis in axes(rig):
        yield _figure(axis, r, taken, rig)


def _figure(axis: str, r: Result, taken: Sequence[Taken], rig: RigFile) -> Figure:
    series: list[Series] = []
    left: list[Series] = []
    some = [(j, s) for j, s in enumerate(r.slopes) if s.axis == axis]
    for j, s in some:
        x, along, rest = _seen(j, s, r, taken)
        ratio, free = r.estimates[RATIO, s.loop].value, r.estimates[FREE, s.loop].value
        ends = np.array([min(x.min(), free), max(x.max(), free)])
        name = f"{s.loop}: {ratio * 1e-3:.2f} A/mm, none at {free * 1e6:.2f} µm"
        series += [Series(f"{s.loop}, measured", x * 1e6, along, "points"),
                   Series(name, ends * 1e6, -(s.own + s.other) * (ends - free)),
                   Series("", np.array([free * 1e6]), np.zeros(1), "mark")]  # fmt: skip
        left.append(Series("", x * 1e6, rest * 1e3, "points"))
    level = abs(upwards(rig, _channel(rig, some[0][1].loop))) < ALONG_WEIGHT
    what = "the magnetic centre" if level else "the magnetic centre and, beside it, what the weight takes of the pull"
    caption = (f"Mean current that pushes along {axis}, both planes moved alike, over the reading. The "
               f"dots are where no current is left: {what}. Below, what the fit of all levels leaves.")  # fmt: skip
    below = Figure(f"left-{axis}", "", "", "reading / µm", "left / mA", tuple(left))
    return Figure(f"levels-{axis}", f"Current that holds along {axis}", caption, "reading / µm", "current / A", tuple(series),
                  lines=(("no current", 0.0),), below=below)  # fmt: skip


def _channel(rig: RigFile, loop: str) -> str:
    assert rig.capabilities.loop_injection is not None
    return rig.capabilities.loop_injection.loops[loop].channel


def _seen(j: int, s: Slope, r: Result, taken: Sequence[Taken]) -> tuple[Array, Array, Array]:
    """Readings, the current against the slope's direction, which pushes along the axis, and what is left of it, of levels with
    both planes moved."""
    used = [
        k for k, t in enumerate(taken) if (t.level.axis, t.level.moved) == (s.axis, BOTH) and t.readings is not None
    ]
    rows = slice(2 * s.plane, 2 * s.plane + 2)
    x = np.array([taken[k].readings[j] for k in used])  # type: ignore[index]
    along = np.array([-taken[k].currents[rows] @ s.direction for k in used])
    return x, along, -r.statics.left[used][:, rows] @ s.direction
