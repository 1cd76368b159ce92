"""What passes draw: friction over the rate of each axis, and what helices rub with over the ratio of speeds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.figures import Figure, Series
from procedures.axis_friction import fit
from procedures.axis_friction.estimates import Result
from procedures.stages.spread import turns

POINTS = 100


def all_figures(r: Result, scale: str) -> Iterator[Figure]:
    """Each axis, then helices; `scale` as the plan has it."""
    for name in r.friction:
        yield _axis(r, name, "known loads" if scale == "loads" else "the controller's map")
    if r.data.helix is not None:
        yield _helix(r)


def _axis(r: Result, name: str, by: str) -> Figure:
    f, axis, rate = r.friction[name], r.data.of[name], r.data.axes[name].rate
    around = turns(axis)
    scale, unit = (1.0, "rad/s") if around else (1e3, "mm/s")
    per, force = (1e3, "mN m") if around else (1.0, "N")
    line = np.linspace(0, rate.max(), POINTS)
    series = (
        Series("mean of the repeats", scale * rate, per * f.at, "points"),
        Series("Coulomb and viscous", scale * line, per * (f.coulomb + f.viscous * line)),
    )
    caption = f"Half the difference of both ways at constant rates, by {by}."
    return Figure(f"friction-{name}", f"Friction: {name}", caption, f"rate / {unit}", f"friction / {force}", series,
                  lines=(("Coulomb", per * f.coulomb),))  # fmt: skip


def _helix(r: Result) -> Figure:
    assert r.data.helix is not None
    assert r.data.pair is not None
    assert r.acted is not None
    assert r.radius is not None
    h = r.data.helix
    along, around = (r.friction[a.name] for a in r.data.pair)
    c = (r.acted[0] - along.viscous * h.v) / along.coulomb
    s = (r.acted[1] - around.viscous * h.w) / around.coulomb
    w = np.geomspace(h.w.min() / 2, 2 * h.w.max(), POINTS)
    shares = fit.path(np.full(POINTS, h.v.mean()), w, r.radius)
    series = (
        Series(f"{r.data.pair[0].name}, of its Coulomb friction", h.w, c, "points"),
        Series(f"{r.data.pair[1].name}, of its Coulomb friction", h.w, s, "points"),
        Series("one friction along the path, along", w, shares[0]),
        Series("one friction along the path, around", w, shares[1]),
    )
    caption = (f"Both axes at once, {h.v.mean() * 1e3:.3g} mm/s along: what Coulomb friction does on each axis. The line is "
               f"one friction along the path of a surface of radius {r.radius * 1e3:.4g} mm. Axes that rub apart stay "
               "at 1.")  # fmt: skip
    return Figure("helix", "Friction where both axes move", caption, "rate around / (rad/s)", "share of Coulomb friction",
                  series, lines=(("alone", 1.0),))  # fmt: skip
