"""The bare model: friction from forces at constant rates, to and fro, without a load and under known ones.

A controller gives forces by its own map, A; what acts is s A, and the map's errors make s differ from place to place, and
between the phases that push and those that pull (s_+ and s_-). At a constant rate v the force that acts is

    s_+ A_+ = f + b,    s_- A_- = -f + b,    f = C + D |v|,

b what the axis needs the same way both ways: its tilt, and half of what friction is more upwards than downwards. Under a load
W that pulls downwards, greater than f, it pushes both ways: the mean of there and back is s_+ m_+ = W + b; pulled upwards
s_- m_- = -(W + b') with b' = -b. With p = A_+/m_+ and q = A_-/m_-, both positive,

    f + b = p (W_1 + b),   f - b = q (W_2 - b)
    b = (p W_1 - q W_2)/(2 - p - q),   f = (p (W_1 + b) + q (W_2 - b))/2.

No scale of the map is left, nor what a pulley rubs with, for that changes its sign with the way. Where both axes move, one
Coulomb force lies along the path of the surface (v, r w): C v/n along and C r r w/n around, n^2 = v^2 + (r w)^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Take = npt.NDArray[np.intp]
WIDEST = 20.0  # times the first guess of a radius


@dataclass(frozen=True)
class Axis:
    """Of one axis, n repeats of r rates: forces given `plus` upwards and `minus` downwards (n, r), `rate` (r,) positive; means
    of there and back under the load that pulls down, `down`, and up, `up` (n,), the first positive, the other negative; empty
    without loads."""

    rate: Array
    plus: Array
    minus: Array
    down: Array
    up: Array


@dataclass(frozen=True)
class Helix:
    """Of n repeats of h rates around: half differences of forces given along and around (n, h), and mean rates (h,)."""

    along: Array
    around: Array
    v: Array
    w: Array


@dataclass(frozen=True)
class Friction:
    """`coulomb` C, `viscous` D and the one-sided force `bias` b of an axis; what friction was at each rate (r,)."""

    coulomb: float
    viscous: float
    bias: float
    at: Array


def balance(p: Array, q: Array, down: float, up: float) -> tuple[Array, Array]:
    """f (n, r) and b (n,) of the ratios p and q (n, r) under loads of that size. At f = W any b would do, so that rates count
    for it by the square of how far they are from that."""
    weight = 2 - p - q
    b = (weight * (p * down - q * up)).sum(axis=-1) / (weight**2).sum(axis=-1)
    return (p * (down + b[..., None]) + q * (up - b[..., None])) / 2, b


def friction(a: Axis, loads: tuple[float, float], take: Take) -> Friction:
    """Of the repeats `take`; each place has its own scale. Without loads `loads` are what a newton of the map is, each way."""
    if a.down.size:
        p, q = a.plus[take] / a.down[take, None], a.minus[take] / a.up[take, None]
        f, b = balance(p, q, *loads)
    else:
        up, low = loads[0] * a.plus[take], loads[1] * a.minus[take]
        f, b = (up - low) / 2, (up + low) / 2
    at = f.mean(axis=0)
    away = a.rate - a.rate.mean()
    viscous = float(away @ at / (away @ away))
    return Friction(float(at.mean() - viscous * a.rate.mean()), viscous, float(b.mean()), at)


def scale(a: Axis, loads: tuple[float, float], bias: float, take: Take) -> float:
    """Newtons per newton of the map, mean of both ways."""
    if not a.down.size:
        return (loads[0] + loads[1]) / 2
    return float(((loads[0] + bias) / a.down[take].mean() + (bias - loads[1]) / a.up[take].mean()) / 2)


def path(v: Array, w: Array, radius: float) -> tuple[Array, Array]:
    """Shares of one friction along and around."""
    n = np.hypot(v, radius * w)
    return v / n, radius * w / n


def helix_forces(h: Helix, scales: tuple[float, float], take: Take) -> tuple[Array, Array]:
    """What acted in helices, along and around."""
    return scales[0] * h.along[take].mean(axis=0), scales[1] * h.around[take].mean(axis=0)


def misfit(
    h: Helix, forces: tuple[Array, Array], along: Friction, around: Friction, radius: float
) -> tuple[Array, Array]:
    """What acted less what one friction along the path gives, as shares of each axis' Coulomb friction."""
    c, s = path(h.v, h.w, radius)
    off_along = (forces[0] - along.viscous * h.v) / along.coulomb - c
    return off_along, (forces[1] - around.viscous * h.w) / around.coulomb - s


def radius_of(h: Helix, forces: tuple[Array, Array], along: Friction, around: Friction) -> float:
    """The radius at which helices rub as they do."""
    from scipy.optimize import minimize_scalar

    guess = np.log(max(around.coulomb / along.coulomb, 1e-9))

    def cost(log_radius: float) -> float:
        off = misfit(h, forces, along, around, float(np.exp(log_radius)))
        return float(sum(x @ x for x in off))

    span = np.log(WIDEST)
    grid = np.linspace(guess - span, guess + span, 41)
    best = float(grid[int(np.argmin([cost(x) for x in grid]))])
    found = minimize_scalar(cost, bounds=(best - 0.2, best + 0.2), method="bounded", options={"xatol": 1e-7})
    return float(np.exp(found.x))


def pseudo(values: Sequence[Array], whole: Array) -> Array:
    """Of n results with one repeat left out each: what each repeat says by itself (Tukey), (n, q)."""
    n = len(values)
    return n * whole - (n - 1) * np.array(values)
