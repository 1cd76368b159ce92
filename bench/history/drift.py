"""A straight line through values over time, with its interval and the time at which its band reaches a limit. Pure.

Least squares without weights: the scatter that counts is the one that the values show about the line. What they have in common
(masses, gains, gravity) moves all of them alike and is no drift, so that their own uncertainties, which are mostly that, do not
enter the slope's. They do enter where the line is asked how near the true value is to a limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bench.figures import Array

TAIL = 0.975  # of each end of a 95 % interval
FEWEST = 3  # values: one more than the line has parameters


@dataclass(frozen=True, slots=True)
class Drift:
    """A line fitted to n values: `slope` per unit of time, `level` at `middle`, the values' mean time; `scatter` is their
    standard deviation about it, `dof` its n - 2 degrees of freedom, `spread` the sum of squares of the times about `middle`."""

    slope: float
    level: float
    middle: float
    scatter: float
    dof: int
    spread: float

    @property
    def count(self) -> int:
        return self.dof + 2

    @property
    def half(self) -> float:
        """Half width of the slope's 95 % interval: t s / sqrt(sum (t_i - mean)^2) (Draper and Smith, 1.4)."""
        return t_factor(self.dof) * self.scatter / math.sqrt(self.spread)

    @property
    def shown(self) -> bool:
        """Whether the interval leaves zero out."""
        return abs(self.slope) > self.half

    def at(self, time: float) -> float:
        """The line."""
        return self.level + self.slope * (time - self.middle)

    def band(self, time: float, common: float = 0.0) -> float:
        """Half width of the 95 % band of the line at a time: t s sqrt(1/n + (time - mean)^2 / sum (t_i - mean)^2), and in root
        of the sum of squares `common`, by which all values may be off together."""
        own = t_factor(self.dof) * self.scatter
        return math.sqrt(own**2 * (1 / self.count + (time - self.middle) ** 2 / self.spread) + common**2)

    def reaches(self, limit: float, upward: bool, after: float, common: float = 0.0) -> float | None:
        """The first time from `after` on at which the band's upper end (`upward`) or lower end reaches `limit`; None if it
        never does. The distance d(T) = limit - at(T) equals the band's half width where d^2 - band^2 = 0, a quadratic."""
        sign = 1.0 if upward else -1.0

        def room(time: float) -> float:
            return sign * (limit - self.at(time)) - self.band(time, common)

        if room(after) <= 0:
            return after
        own = (t_factor(self.dof) * self.scatter) ** 2
        gap = limit - self.level
        a = self.slope**2 - own / self.spread
        b = -2 * gap * self.slope
        c = gap**2 - own / self.count - common**2
        roots = sorted(self.middle + x for x in _roots(a, b, c))
        ahead = [r for r in roots if r > after and sign * (limit - self.at(r)) >= 0]
        return ahead[0] if ahead else None


def fitted(times: Array, values: Array) -> Drift | None:
    """The line through values (n,) at times (n,); None of fewer than three, and where all are of one time."""
    if values.size < FEWEST:
        return None
    middle, level = float(np.mean(times)), float(np.mean(values))
    off = times - middle
    spread = float(off @ off)
    if spread == 0:
        return None
    slope = float(off @ (values - level)) / spread
    left = values - level - slope * off
    dof = values.size - 2
    return Drift(slope, level, middle, math.sqrt(float(left @ left) / dof), dof, spread)


def _roots(a: float, b: float, c: float) -> list[float]:
    """Real roots of a x^2 + b x + c."""
    if a == 0:
        return [-c / b] if b else []
    inside = b * b - 4 * a * c
    if inside < 0:
        return []
    q = -(b + math.copysign(math.sqrt(inside), b)) / 2
    return [q / a, *([c / q] if q else [])]


def t_factor(dof: int) -> float:
    """t_0.975(dof), by Newton's method on its distribution. scipy has it, but its import takes longer than all of a trend."""
    x = 2.0
    for _ in range(60):
        step = (_t_within(x, dof) - (2 * TAIL - 1)) / (2 * _t_density(x, dof))
        x = max(x - step, x / 2) if step > 0 else min(x - step, 4 * x)
        if abs(step) < 1e-13 * x:
            break
    return x


def _t_density(x: float, dof: int) -> float:
    whole = math.lgamma((dof + 1) / 2) - math.lgamma(dof / 2) - math.log(dof * math.pi) / 2
    return math.exp(whole - (dof + 1) / 2 * math.log1p(x * x / dof))


def _t_within(x: float, dof: int) -> float:
    """Probability that |t| < x, a finite sum for whole degrees of freedom (Abramowitz and Stegun, 26.7.3 and 26.7.4)."""
    angle = math.atan2(x, math.sqrt(dof))
    cos2, sin = dof / (dof + x * x), x / math.sqrt(dof + x * x)
    term, total = (math.sqrt(cos2), 0.0) if dof % 2 else (1.0, 0.0)
    for k in range(1 + dof % 2, dof, 2):
        total += term
        term *= cos2 * k / (k + 1)
    return 2 / math.pi * (angle + sin * total) if dof % 2 else sin * total


def chi2_ratio(dof: int, above: float = 2.326348) -> float:
    """The 99 % quantile of chi^2/dof, by Wilson and Hilferty (PNAS 17, 684 (1931)); `above` is that of a normal value."""
    part = 2 / (9 * dof)
    return float((1 - part + above * math.sqrt(part)) ** 3)
