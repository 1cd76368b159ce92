"""Zeros of stators and what friction leaves of them.

A phase that carries i turns the shaft until its torque is what friction takes, k q(i) d = -T_c sign of the motion, so that from
above it stops at d = T_c/(k q) and from below at -d. The mean of both is the zero where friction is alike both ways; half of
their difference, the band, falls as 1/q. What pulls steadily (a cord, an unbalance) moves both ways alike, also as 1/q: the
means of the levels are a line over 1/q = 2/i^2 roughly, and show it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.map_zero.steps import Array, Rest
from procedures.shared.leastsquares import linear
from procedures.stages.stators import axis

BOTH = (-1, 1)
COUNT = 1 / math.sqrt(12)  # standard uncertainty of a reading within its count
PARTS = 6  # of a count: of the phases, and of both sides
FEW = 6


@dataclass(frozen=True)
class Stator:
    """Of one motor: `levels` A; by alignment (n, levels), from below and from above, what was read less where the rig file has
    the phase aligned, rad; names of the alignments; its quantities."""

    motor: str
    names: tuple[str, ...]
    levels: Array
    below: Array
    above: Array
    estimates: dict[str, Estimate]

    @property
    def angles(self) -> Array:
        """Where phases are aligned, rad (n,)."""
        return np.radians([float(name.rpartition(", ")[2].rstrip("°")) for name in self.names])

    @property
    def means(self) -> Array:
        """Of both sides (n, levels)."""
        return 0.5 * (self.below + self.above)

    @property
    def bands(self) -> Array:
        """Half of what both sides differ by."""
        return 0.5 * (self.above - self.below)


def stators(rests: Sequence[Rest], rig: RigFile) -> list[Stator]:
    """Of each motor, of alignments that were come to from both sides at every level."""
    out = []
    levels = sorted({r.level for r in rests})
    by = {(r.approach.phase.name, r.approach.tooth, r.approach.side, r.level): r for r in rests}
    for motor in dict.fromkeys(r.approach.phase.motor for r in rests):
        keys = dict.fromkeys(
            (r.approach.phase.name, r.approach.tooth) for r in rests if r.approach.phase.motor == motor
        )
        whole = [k for k in keys if all((*k, side, level) in by for side in BOTH for level in levels)]
        if len(whole) < 3:
            continue
        below, above = (np.array([[off(by[*k, side, level]) for level in levels] for k in whole]) for side in BOTH)
        names = tuple(
            f"{name}, {math.degrees(by[name, tooth, 1, levels[0]].approach.aligned):.4g}°" for name, tooth in whole
        )
        made = Stator(motor, names, np.array(levels), below, above, {})
        made.estimates.update(_estimates(made, rig))
        out.append(made)
    return out


def off(rest: Rest) -> float:
    """What the encoder reads less where the rig file has the phase aligned, rad, to the nearest turn."""
    return math.remainder(rest.angle - rest.approach.aligned, 2 * math.pi)


def _estimates(of: Stator, rig: RigFile) -> Mapping[str, Estimate]:
    """Over all alignments, without what goes once a turn with the angle: the encoder's own error, and what unevenness draws
    aside. Their scatter has most of what counts do; readings that agree to the count show none of it, so that it is told
    beside."""
    angle, out = axis(rig, "angle"), {}
    for name, each in (("zero", of.means.mean(axis=1)), ("band", of.bands[:, -1])):
        value, u, dof = mean_around(each, of.angles)
        scatter = Influence(f"scatter/{of.motor}/{name}", "scatter of the alignments", u, "rad", "A", "normal", dof)
        out[name] = Estimate.of(value, scatter)
        if angle is not None and angle.pitch is not None:
            readings = len(of.levels) if name == "zero" else 1
            rounded = angle.pitch.value * COUNT / math.sqrt(PARTS * readings)
            counts = Influence(f"counts/{of.motor}/{name}", "counts of the encoder", rounded, "rad", "B", "normal")
            out[name] = out[name] + Estimate.of(0.0, counts)
    return out


def mean_around(each: Array, angles: Array) -> tuple[float, float, float]:
    """Mean of what was found at angles, without what goes once a turn; its standard uncertainty and degrees of freedom. Of less
    than six alignments it is the plain mean."""
    n = len(each)
    if n < FEW:
        return float(each.mean()), float(each.std(ddof=1)) / math.sqrt(n), n - 1.0
    fit = linear(np.column_stack([np.ones(n), np.cos(angles), np.sin(angles)]), each)
    return float(fit.terms[0]), float(fit.u[0]), float(fit.dof)


def drift(of: Stator) -> tuple[float, float]:
    """How far the mean of both sides is off at the first level as against the last, and its standard uncertainty, rad."""
    each = of.means[:, 0] - of.means[:, -1]
    return float(each.mean()), float(each.std(ddof=1) / math.sqrt(len(each)))
