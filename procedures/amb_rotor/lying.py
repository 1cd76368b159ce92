"""What each axis of a shaft's bearings must give to carry it, and how far off the middle the shaft lies there on its rings.

A ring of clearance c carries the shaft where gravity and its own lever press it: below the middle, or, where it overhangs,
above it. Numbers are moved by identity, `v`: what is not there has the value that the rig file states.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from bench.rigfile.numbers import Sum, Term
from procedures.amb_rotor.stations import Ring, Stations, row, upward

Array = npt.NDArray[np.float64]
ONE_PLACE_M = 1e-6  # rings that are nearer carry the shaft in one
NOTHING = 1e-3  # of the weight: an axis that carries no more is level


def carried(s: Stations, load: float, v: Mapping[str, float]) -> Array:
    """What each axis (4,) must give to carry `load` N of weight, N, the way in which it counts."""
    pulls = np.array([row(number(p.arm, v), number(p.angle, v)) for p in s.axes.values()])
    up = upward(number(s.first, v), s.hand, number(s.tilt, v))
    return np.asarray(np.linalg.solve(pulls.T, load * np.array([*up, 0.0, 0.0])))


def lies(s: Stations, k: int) -> float:
    """How far a shaft on its rings lies off the middle along axis k, the way in which that must pull, m: below 0, away from the
    coil that pulls; 0 where its rings are not two, or where it stands."""
    up, own = np.array(s.up), [*s.axes.values()][k]
    if len(s.rings) != 2 or np.hypot(*up) < NOTHING:
        return 0.0
    (near, at_near), (far, at_far) = ((_arm(s, r), abs(r.clearance.number.value)) for r in s.rings)
    if abs(far - near) < ONE_PLACE_M:
        return 0.0
    at_rings = -np.array([math.copysign(at_near, far / (far - near)), math.copysign(at_far, near / (near - far))])
    share = (own.arm.value - near) / (far - near)
    along = float(np.dot(up / np.hypot(*up), [math.cos(own.angle.value), math.sin(own.angle.value)]))
    off = (at_rings[0] * (1 - share) + at_rings[1] * share) * along
    return float(off * math.copysign(1.0, carried(s, 1.0, {})[k]))


def placed(s: Stations) -> Iterator[Term]:
    """Every number of the axes' places and directions, and of how the shaft lies."""
    for part in s.axes.values():
        yield from (*part.arm.terms, *part.angle.terms)
    yield from (*s.first.terms, *s.tilt.terms)


def number(of: Sum, v: Mapping[str, float]) -> float:
    """A sum with its numbers moved, SI."""
    return of.exact + sum(t.factor * v.get(t.identity, t.number.value) for t in of.terms)


def _arm(s: Stations, ring: Ring) -> float:
    """Of a ring from the centre of mass, m: its own, or that of its plane's probes."""
    if ring.arm is not None:
        return ring.arm.value
    probes = [p.arm.value for p in s.probes.values()]
    return (min(probes), max(probes))[ring.plane]
