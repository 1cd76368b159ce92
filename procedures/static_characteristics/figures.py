"""What load cells show: torque and force over the angle, and what the formula leaves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.figures import Figure, Series, Shown
from procedures.inductance_map.model import advance, angular, overlapped
from procedures.static_characteristics.estimates import Result
from procedures.static_characteristics.model import MAP, Array, Rows, Terms, q_of

POINTS = 181


def all_figures(r: Result) -> Iterator[Shown]:
    """Torque, force."""
    yield _loads(r, 1)
    yield _loads(r, 0)


def _loads(r: Result, axis: int) -> Figure:
    """Of all phases by their own gains, at the greatest current, over the angle from where each is aligned; torque over the
    depth in its stator, which it goes with."""
    of, t = r.rows, r.found.terms
    m, gain = dict(zip(MAP, t, strict=False)), t[Terms(len(of.x)).each("gain")]
    zero = np.where(of.stator == 0, m["zero_1"], m["zero_2"])
    period = 2 * np.pi / of.poles
    d = (of.angle[of.place] - of.aligned[of.phase] - zero[of.phase] + period / 2) % period - period / 2
    per = _per(of, m, gain, axis)
    load, left = (of.force, of.torque)[axis] / per, r.found.residuals[axis]
    greatest = np.abs((of.force, of.torque)[axis]).max()
    line = np.linspace(-period / 2, period / 2, POINTS)
    points = tuple(
        Series(p.name, np.degrees(d[of.phase == k]), load[of.phase == k], "points") for k, p in enumerate(r.phases)
    )
    below = Figure(
        "residuals", "Residuals", "", "angle from the aligned one / °", "residual / %",
        tuple(Series(p.name, np.degrees(d[of.phase == k]), 100 * left[of.phase == k] / greatest, "points")
              for k, p in enumerate(r.phases)),
    )  # fmt: skip
    name, unit = (("Force", "H/m"), ("Torque", "H/(m rad)"))[axis]
    caption = (f"{name} by load cells over what the current makes of it, over the phase's gain "
               f"{'and over its depth in the stator' if axis else 'towards its stator'}; the line is the formula. "
               "Residuals are shares of the greatest load.")  # fmt: skip
    label = f"{name.lower()} / ({unit})"
    return Figure(name.lower(), f"{name} of the phases", caption, "angle from the aligned one / °", label,
                  (*points, Series("formula", np.degrees(line), _curve(m, of, line, axis), "line")), below=below)  # fmt: skip


def _per(of: Rows, m: dict[str, float], gain: Array, axis: int) -> Array:
    """What a load is divided by: Q(i), gain, and the part of the overlap."""
    side = of.side[of.phase]
    o = m["overlap"] + side * (of.x[of.place] - m["centre"])
    over = overlapped(o, m["length"], m["fringe"]) if axis else side * advance(o, m["length"], m["fringe"])
    angle = of.angle[of.place]
    even = 1 + m["cosine"] * np.cos(angle) + m["sine"] * np.sin(angle)
    return np.asarray(q_of(of.current, m["saturation"]) * gain[of.phase] * over * even)


def _curve(m: dict[str, float], of: Rows, d: Array, axis: int) -> Array:
    value, bend = angular(d, m["unaligned"], m["c2"], m["c3"], of.poles)
    return np.asarray(m["slope"] * (bend if axis else value))
