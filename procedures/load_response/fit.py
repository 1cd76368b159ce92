"""The bare model: where friction and a spring hold an axis under a load, and what its approaches from both sides tell of it.

At rest, with the deviation e of the reading from the set point, the load P along the axis and the friction R:

    s k e = P + R,   |R| <= F_c

k the stiffness that the controller is set to, s how much force it gives for what it takes for a newton. An axis that is moved
slowly upwards comes to rest with R = -F_c, downwards with R = +F_c: the mean of both is P/(s k), half of their difference
F_c/(s k). The reading is a whole count p. A slow axis stops as soon as a count takes so much off the spring that friction
holds it, so that the last count is passed by up to p: by p/2 in the mean over set points that are spread over one count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Pairs:
    """Approaches from both sides, (J, K) by load and set point: `mean` deviation, `half` of the difference, downwards less
    upwards, m or rad; `given`, mean force of both, N or N m."""

    mean: Array
    half: Array
    given: Array


@dataclass(frozen=True)
class Slope:
    """Straight line of loads' means over their forces, `value` per newton and where it is without load; `u`, standard
    uncertainty of both by the scatter of the set points of each load, with `dof`."""

    value: float
    zero: float
    u: float
    u_zero: float
    dof: int


def line(force: Array, of: Array) -> tuple[float, float]:
    """Slope and zero of `of` (J, K) over `force` (J,).

    Raises:
        AnalysisError: loads that are all alike.
    """
    means = of.mean(axis=1)
    away = force - force.mean()
    square = float(away @ away)
    if square == 0:
        raise AnalysisError("found loads that are all alike; expected some that differ")
    slope = float(away @ means) / square
    return slope, float(means.mean() - slope * force.mean())


def uneven(of: Array) -> tuple[float, int]:
    """Standard uncertainty of the mean of a row, all rows together, by what every other point is off the rest; degrees of
    freedom. Points are spread evenly over a count, so that what goes with the place in it slowly is in no mean; of points that
    scatter by themselves it is their standard deviation over the root of their number."""
    signs = np.where(np.arange(of.shape[1]) % 2, -1.0, 1.0)
    return math.sqrt(float(np.mean((of @ signs / of.shape[1]) ** 2))), len(of)


def scatter(of: Array) -> tuple[float, int]:
    """Standard deviation of single values about the mean of their row, all rows together; degrees of freedom."""
    dof = of.shape[0] * (of.shape[1] - 1)
    return math.sqrt(float(((of - of.mean(axis=1, keepdims=True)) ** 2).sum()) / dof), dof


def slope(force: Array, of: Array) -> Slope:
    """The line, with its scatter."""
    value, zero = line(force, of)
    per, dof = uneven(of)
    away = force - force.mean()
    square = float(away @ away)
    u_zero = per * math.sqrt(1 / len(force) + force.mean() ** 2 / square)
    return Slope(value, zero, per / math.sqrt(square), u_zero, dof)


def bends(force: Array, of: Array) -> float:
    """How far slopes between neighbouring loads differ from that of the line: the root of their mean square, relative."""
    value, _ = line(force, of)
    at = np.unique(force)
    means = np.array([of[force == f].mean() for f in at])
    found = np.diff(means) / np.diff(at) / value - 1
    return float(np.sqrt(np.mean(found**2)))


def pairwise(force: Array, of: Array, masses: Array) -> list[float]:
    """Slope by each mass alone, both ways: `masses` (J,) its number, -1 without load."""
    out = []
    for k in sorted({int(m) for m in masses if m >= 0}):
        rows = masses == k
        if len(np.unique(np.sign(force[rows]))) == 2:
            out.append(line(force[rows], of[rows])[0])
    return out


@dataclass(frozen=True)
class Answers:
    """To one kind of change, over set points (K,): greatest deviation in the load's direction, what is left at the end, and the
    greatest deviation `against` that direction."""

    peak: Array
    left: Array
    against: Array


def answer(times: Array, deviation: Array, after_s: float, look_s: float) -> tuple[float, float, float]:
    """Greatest deviation within `after_s` after the change, its mean over `look_s` from then on, and the greatest against the
    load; `deviation` is positive in the direction in which the load drives the axis."""
    within = (times >= 0) & (times <= after_s)
    late = (times >= after_s) & (times <= after_s + look_s)
    if not late.any():
        raise AnalysisError(f"found no sample {after_s:g} s after the load; expected a step that is longer")
    path = deviation[within]
    return float(path.max()), float(deviation[late].mean()), float(-path.min())
