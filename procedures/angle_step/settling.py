"""Settling times of steps whose swings may end at the band by chance.

The time from the answer until the angle stays in its band jumps by half a swing where a swing only just touches the band. What
is told is the mean over what the angle may be off: in each step by itself, which is noise, and in all steps of one way alike.
Both have the jump in them where it may happen, and nothing of it where a swing surely stays or leaves. Where the steps of a way
all end in the same swing, what noise does is what their times scatter by: that of the first top, which is higher, is more.
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
SHARES = (np.arange(41) + 0.5) / 41  # quantiles by which an angle that is unsure may be off
SURE = 10**6  # degrees of freedom
STANDS = 1.5  # counts off its reference: where it may end, for good


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

    def times(self, off: Array) -> Array:
        """The settling time, s, by angles that are `off`, rad: where a swing ends within that of the band, some have it, some
        do not."""
        return np.array([self.course.last_outside(self.size, self.band - by) for by in off]) - self.answers

    @property
    def time(self) -> float:
        """That of the angle as it is read."""
        return float(self.times(np.zeros(1))[0])

    def earlier(self, count: float) -> float:
        """By how much, s, it settles earlier from a start that is a `count`, rad, further: its swings are smaller by that share
        of the step, as if the band were wider by it."""
        return self.time - float(self.times(np.array([-self.band * count / self.size]))[0])

    def swells(self, first: float, last: float) -> float:
        """By how much, rad, the distance to the target grows again between two settling times, s: between swings it does."""
        t = self.course.t - self.answers
        far = np.abs(self.course.y[(t >= first) & (t <= last)] - self.size)
        return float(np.max(far - np.minimum.accumulate(far), initial=0.0))


def settled(
    where: str, found: Sequence[Settling], noisy: tuple[float, int], between: float, count: float
) -> Estimate:  # fmt: skip
    """The mean over the steps, s, and over what their angles may be off; `noisy`: what noise does to a turning point as it is
    read, rad, and the degrees of freedom by which it may be more; `between` counts: what all turning points of one way are off
    alike. A start that is a count further makes all swings smaller as it does the step, one at the band by that share of it."""
    each = np.array([s.times(_off(s, noisy, count)) for s in found])
    chance = Influence(id=f"scatter/settling_time/{where}", name="whether a swing leaves the band", unit="s", kind="B",
                       u=math.sqrt(float(each.var(axis=1).sum())) / len(found), distribution="normal")  # fmt: skip
    return Estimate.of(float(each.mean()), chance) + read(where, found, between, count)


def jumps(found: Sequence[Settling], noisy: tuple[float, int], between: float, count: float) -> bool:
    """Whether the steps of one way may end in one swing or in another, by what their angles may be off, as in `settled`."""
    off = [(_off(s, noisy, count), _normal(s.course.unsure(between, count))) for s in found]
    every = np.array([s.times(np.concatenate(by)) for s, by in zip(found, off, strict=True)])
    for way in WAYS:
        here = [k for k, s in enumerate(found) if s.forward is way]
        first, last = float(every[here].min(initial=math.inf)), float(every[here].max(initial=-math.inf))
        if any(found[k].swells(first, last) > np.max(off[k]) for k in here):
            return True
    return False


def _off(s: Settling, noisy: tuple[float, int], count: float) -> Array:
    """Quantiles of what noise and a loose start make of a step's angle, rad; not so far that the angle would be outside its
    band while it stands and trembles, by which no swing is told."""
    from scipy import special

    unsure = math.hypot(noisy[0], s.band * count / s.size / math.sqrt(12) if s.loose else 0.0)
    most = max(s.band - STANDS * count, 0.0)
    return np.asarray(np.clip(unsure * special.stdtrit(noisy[1], SHARES), -most, most))


def _normal(u: float) -> Array:
    """Quantiles of what is normal, rad."""
    from scipy import special

    return np.asarray(u * special.ndtri(SHARES))


def read(where: str, found: Sequence[Settling], between: float, count: float) -> Estimate:
    """Zero, s, with what turning points do that are off in all steps of one way alike, by `between` counts."""
    alike = np.array([s.times(_normal(s.course.unsure(between, count))) for s in found])
    ways = [np.array([a for a, s in zip(alike, found, strict=True) if s.forward is way]) for way in WAYS]
    variances = [float(way.mean(axis=0).var()) for way in ways if len(way)]
    influence = Influence(id=f"edges/settling/{where}", name="encoder between its counts", unit="s", kind="B",
                          u=math.sqrt(sum(variances)) / len(variances), distribution="normal")  # fmt: skip
    return Estimate.of(0.0, influence)


def split(found: Sequence[Settling], values: Sequence[float]) -> list[list[float]]:
    """By their ways."""
    return [[v for v, s in zip(values, found, strict=True) if s.forward is way] for way in WAYS]
