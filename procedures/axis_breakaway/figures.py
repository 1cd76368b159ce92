"""What ramps draw: breakaway by repeats, and of both axes at once on the circle of one friction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.figures import Figure, Series
from procedures.axis_breakaway.estimates import Result


def all_figures(r: Result) -> Iterator[Figure]:
    """The circle, then each axis, and what acts beside it."""
    if r.data.helix is not None:
        yield _circle(r)
    for name in r.data.of:
        yield _axis(r, name)
        if name in r.beside:
            yield _beside(r, name)


def _axis(r: Result, name: str) -> Figure:
    a, axis = r.data.axes[name], r.data.of[name]
    per = 1e3 if axis.unit == "rad" else 1.0
    what, unit = ("torque", "mN m") if axis.unit == "rad" else ("force", "N")
    n = np.arange(1.0, len(a.plus) + 1)
    series = (Series("up", n, per * a.plus, "points"), Series("down", n, -per * a.minus, "points"))
    caption = (f"{what.capitalize()} by the controller's map at which it begins to move, repeat by repeat, at other places "
               "each; the line is the result by known loads.")  # fmt: skip
    return Figure(f"breakaway-{name}", f"Breakaway: {name}", caption, "repeat", f"{what} by the map / {unit}", series,
                  lines=(("result", per * r.at[name]),))  # fmt: skip


def _beside(r: Result, name: str) -> Figure:
    s, left = r.beside[name]
    angle = np.linspace(-1, 1, 97) * np.arcsin(min(1.1 * float(np.abs(s).max()), 1.0))
    series = (Series("ramps", s, left, "points"), Series("one friction along the path", np.sin(angle), np.cos(angle)))
    caption = ("What is left of its friction where the other axis is pulled: beside what of that one's own, with what the "
               "map crosses, as shares. Points on a line that is level would be axes that rub apart.")  # fmt: skip
    return Figure(f"beside-{name}", f"Breakaway beside another axis: {name}", caption, "beside, share", f"{name}, share",
                  series)  # fmt: skip


def _circle(r: Result) -> Figure:
    assert r.data.helix is not None
    names = [n for turned in (False, True) for n, a in r.data.of.items() if (a.unit == "rad") is turned][:2]
    along, around = (np.abs(r.data.helix[..., k]) / r.at[n] for k, n in enumerate(names))
    angle = np.linspace(0, np.pi / 2, 91)
    series = (
        *(
            Series(f"helix {s:g}", along[:, j].ravel(), around[:, j].ravel(), "points")
            for j, s in enumerate(r.data.shares)
        ),
        Series("one friction along the path", np.cos(angle), np.sin(angle)),
        Series("axes that rub apart", np.array([0.0, 1.0, 1.0]), np.array([1.0, 1.0, 0.0]), "guide"),
    )
    caption = ("Both at once: force by the controller's map along and around where the first reading changes, as shares "
               "of what each "
               "axis breaks away at alone.")  # fmt: skip
    return Figure("circle", "Breakaway where both axes are pushed", caption, f"{names[0]}, share",
                  f"{names[1]}, share", series)  # fmt: skip
