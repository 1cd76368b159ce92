"""The bare model: at which force an axis begins to move, and what that is in newtons.

A set point creeps by a rate v, and the force by R = k v, k the loop's stiffness. The axis sticks until the force on it is the
friction's, and is seen to move when its reading changes by a count p. Until then the force has gone on: with R t more than
friction it goes R t^3/(6 J), so that after a way u p, u between 0 and 1 by where in its count it stuck, the force is

    beyond = (6 J u p R^2)^(1/3)

too great: by 3/4 of the greatest in the mean over u, and never by more than it nor by less than nothing.

Forces by the controller's map become newtons as those of constant rates do (`axis_friction.fit.balance`): the mean of there
and back under a load W that pulls one way, and then the other, tells what a newton of the map is when it pushes either way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.axis_friction.fit import balance

Array = npt.NDArray[np.float64]
Take = npt.NDArray[np.intp]
MEAN = 0.75  # of u^(1/3) for u between 0 and 1
STAYS = 100  # samples, of which most are to be elsewhere once an axis has begun to move
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
