"""The bare model: at which force an axis begins to move, and what that is in newtons.

A set point creeps by a rate v, and the force by R = k v, k the loop's stiffness. The axis sticks until the force on it is the
friction's, and is seen to move when its reading changes by a count p. Until then the force has gone on: with R t more than
friction it goes R t^3/(6 J), so that after a way u p, u between 0 and 1 by where in its count it stuck, the force is

    beyond = R t = (6 J u p R^2)^(1/3)                                                                   (1)

too great: by 3/4 of the greatest in the mean over u, and never by more than it nor by less than nothing. Its variance over u
is 3/5 - 9/16 = 3/80 of the greatest's square: most of a count is passed late and fast, so that little of it is told by chance.

Friction is one force along the path of the surface, so that a torque T beside a force F takes some of it: both give way at
(F/F_c)^2 + (T/T_c)^2 = 1. Of T the controller knows what it gives by its map, G, and not what its map crosses of a force A
along, c A by the same map: T = b (G + c A). Pulled by several G at one place, an axis gives way at

    A = A_c - F_c (1 - sqrt(1 - s^2)),   s = (G + c A)/G_c,   G_c = T_c/b,                               (2)

c another at each place and way, A_c what it needs with nothing beside: its friction, with what hangs on it and rubs there.
F_c/(2 G_c^2), how much the force bends with G, is one number for all places of a way; three pulls or more tell it, and no
radius of a bearing is asked for. Axes that rub apart bend nothing, and nothing is added.

Once both give way they go on along the path on which friction was broken, q_j' = r q_k', for it turns with them and would turn
them back at once: r = (s/sqrt(1 - s^2)) F_c/T_c beside an axis along. The other's inertia goes along, and its force rises, too:

    (J_k + r^2 J_j) q_k'' = (R_k + r R_j) t,   t = (6 (J_k + r^2 J_j) u p_k/(R_k + r R_j))^(1/3),         (3)

and the force of each is R t too great when the first reading changes, by 3/4 of the greatest in the mean.

Forces by the controller's map become newtons as those of constant rates do (`axis_friction.fit.balance`): the mean of there
and back under a load W that pulls one way, and then the other, tells what a newton of the map is when it pushes either way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.axis_friction.fit import balance

Array = npt.NDArray[np.float64]
Take = npt.NDArray[np.intp]
MEAN = 0.75  # of u^(1/3) for u between 0 and 1
DEVIATION = math.sqrt(3 / 80)  # its standard deviation
STAYS = 100  # samples, of which most are to be elsewhere once an axis has begun to move
ROUNDS = 8  # of what is solved by turns
TINY = 1e-30
MOST = 0.9  # share of what breaks away, beyond which nothing is told of it
RISE = 0.5  # of a ramp before its end, over which the rise of the force is told


def broke_away(reading: Array, way: float) -> int | None:
    """The first sample from which on a reading (n,), signed as it is pushed, is mostly a `way` or more from the least so far;
    None: it never moves. What goes on the other way at first counts not; a loop whose derivative answers the count may throw
    the axis back over its edge for some samples."""
    gone = reading - np.minimum.accumulate(reading) > 0.75 * way
    for at in np.flatnonzero(gone):
        if gone[at : at + STAYS].mean() > 0.5:
            return int(at)
    return None


def rise(t: Array, force: Array, at: int) -> float:
    """Of the force before it breaks away, per second."""
    first = int((1 - RISE) * at)
    if at - first < 3:
        return 0.0
    away = t[first:at] - t[first:at].mean()
    return float(away @ force[first:at] / (away @ away))


def beyond(inertia: float, count: float, rise_per_s: float) -> float:
    """The greatest force, N or N m, by which friction is exceeded before a count is seen."""
    return float((6 * inertia * count * rise_per_s**2) ** (1 / 3))


def passes(inertia: Array, count: float, rise_per_s: Array) -> Array:
    """How long it takes at most until a count is seen, s: (3) with u = 1."""
    return np.asarray(np.cbrt(6 * inertia * count / rise_per_s))


@dataclass(frozen=True)
class Bend:
    """How an axis' friction F_c, N by its map, bends with what acts beside it: `limit` G_c, by the other axis' map, infinite
    where nothing bends; `u` of F_c/(2 G_c^2), as a share of it."""

    friction: float
    limit: float
    u: float


def bend(force: Array, beside: Array, friction: float) -> Bend:
    """Of forces (m, p), positive the way they push, by what acted beside them (m, p), as (2): by least squares, each of m
    places with its own A_c and c. What is not linear in them is taken off by turns."""
    found = Bend(friction, math.inf, 0.0)
    crossed = np.zeros((len(force), 1))
    for _ in range(ROUNDS):
        s = shares(force, beside, found)
        if math.isfinite(found.limit):
            crossed = np.mean(s * found.limit - beside, axis=1, keepdims=True) / force.mean(axis=1, keepdims=True)
        square = _straightened(beside * force, beside**2 + (crossed * force) ** 2)
        off = _straightened(beside * force, force + friction * (_lost(s) - s**2 / 2))
        half = -float((square * off).sum()) / max(float((square**2).sum()), TINY)
        if half <= 0:
            return Bend(friction, math.inf, 0.0)
        left = (square * (off + half * square)).sum(axis=1)
        found = Bend(
            friction, math.sqrt(friction / (2 * half)), float(np.hypot.reduce(left) / (square**2).sum() / half)
        )
    return found


def shares(force: Array, beside: Array, bent: Bend) -> Array:
    """s (m, p) of (2): what acts beside as a share of what would break away alone."""
    s, crossed = np.zeros_like(force), np.zeros((len(force), 1))
    if not math.isfinite(bent.limit):
        return s
    by, per = beside * force, bent.friction / bent.limit**2
    away = by - by.mean(axis=1, keepdims=True)
    for _ in range(ROUNDS):
        straight = force + bent.friction * (_lost(s) - s**2 / 2) + per / 2 * (beside**2 + (crossed * force) ** 2)
        slope = (away * straight).sum(axis=1, keepdims=True) / np.maximum((away**2).sum(axis=1, keepdims=True), TINY)
        crossed = -slope / per
        s = np.clip((beside + crossed * force) / bent.limit, -MOST, MOST)
    return s


def alone(force: Array, s: Array, bent: Bend) -> Array:
    """A_c (m,) of (2), mean of all pulls."""
    return np.asarray((force + bent.friction * _lost(s)).mean(axis=1))


def _lost(s: Array) -> Array:
    return np.asarray(1 - np.sqrt(1 - s**2))


def _straightened(x: Array, y: Array) -> Array:
    """What is left of y (m, p) by straight lines in x (m, p), each place by its own."""
    away = x - x.mean(axis=1, keepdims=True)
    slope = (away * y).sum(axis=1, keepdims=True) / np.maximum((away**2).sum(axis=1, keepdims=True), TINY)
    return np.asarray(y - y.mean(axis=1, keepdims=True) - slope * away)


@dataclass(frozen=True)
class Axis:
    """Of n repeats: forces `plus` upwards and `minus` downwards (n,); means of there and back under the load that pulls down,
    `down`, and up, `up` (n,)."""

    plus: Array
    minus: Array
    down: Array
    up: Array


def breakaway(a: Axis, weights: tuple[float, float], take: Take) -> float:
    """Of the repeats `take`, N or N m; `weights` what loads pull with."""
    p, q = a.plus[take] / a.down[take], a.minus[take] / a.up[take]
    f, _ = balance(p[:, None], q[:, None], *weights)
    return float(f.mean())


def newtons(a: Axis, weights: tuple[float, float], take: Take) -> tuple[float, float]:
    """What a newton of the map is when it pushes up and down."""
    p, q = a.plus[take] / a.down[take], a.minus[take] / a.up[take]
    _, b = balance(p[:, None], q[:, None], *weights)
    return float(((weights[0] + b) / a.down[take]).mean()), float(((b - weights[1]) / a.up[take]).mean())
