"""Settling times of steps whose swings may end at the band by chance.

The time from the answer until the angle stays in its band jumps by half a swing where a swing only just touches the band. What
is told is the mean over what the angle may be off: in each step by itself, which is noise, and in all steps of one way alike.
Both have the jump in them where it may happen, and nothing of it where a swing surely stays or leaves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.uncertainty import Estimate, Influence
from procedures.angle_step.course import Course

Array = npt.NDArray[np.float64]
WAYS = (True, False)  # to the angle, and back
QUANTILES = 41  # by which an angle that is unsure may be off
SURE = 10**6  # degrees of freedom


@dataclass(frozen=True)
class Settling:
    """Of one step, `forward` or back: the `course` of the angle from where it began, its `size` and the `band`, rad, and when
    the torque current `answers`, s. `loose`: what chance does to its start may be a count."""

    forward: bool
    course: Course
    size: float
    band: float
    answers: float
    loose: bool = False

    def times(self, unsure: float, dof: int = SURE) -> Array:
        """The settling time, s, by angles that are off by so much, rad, times the quantiles of t: where a swing ends within
        that of the band, some have it and some do not."""
        from scipy import special

        off = unsure * special.stdtrit(dof, (np.arange(QUANTILES) + 0.5) / QUANTILES)
        return np.array([self.course.last_outside(self.size, self.band - by) for by in off]) - self.answers


def settled(
    where: str, found: Sequence[Settling], noisy: tuple[float, int], between: float, count: float
) -> Estimate:  # fmt: skip
    """The mean over the steps, s, and over what their angles may be off; `noisy`: what noise does to a turning point as it is
    read, rad, and the degrees of freedom by which it may be more; `between` counts: what all turning points of one way are off
    alike. A start that is a count further makes all swings smaller as it does the step, one at the band by that share of it."""
    off = [math.hypot(noisy[0], s.band * count / s.size / math.sqrt(12) if s.loose else 0.0) for s in found]
    each = np.array([s.times(by, noisy[1]) for s, by in zip(found, off, strict=True)])
    alike = np.array([s.times(s.course.unsure(between, count)) for s in found])
    chance = Influence(id=f"scatter/settling_time/{where}", name="whether a swing leaves the band", unit="s", kind="B",
                       u=math.sqrt(float(each.var(axis=1).sum())) / len(found), distribution="normal")  # fmt: skip
    ways = [np.array([a for a, s in zip(alike, found, strict=True) if s.forward is way]) for way in WAYS]
    variances = [float(way.mean(axis=0).var()) for way in ways if len(way)]
    read = Influence(id=f"edges/settling/{where}", name="encoder between its counts", unit="s", kind="B",
                     u=math.sqrt(sum(variances)) / len(variances),
                     distribution="normal")  # fmt: skip
    return Estimate.of(float(each.mean()), chance) + Estimate.of(0.0, read)


def split(found: Sequence[Settling], values: Sequence[float]) -> list[list[float]]:
    """By their ways."""
    return [[v for v, s in zip(values, found, strict=True) if s.forward is way] for way in WAYS]
