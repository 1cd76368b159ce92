"""Control charts of single values in their order: individuals with moving range, EWMA, CUSUM. Pure functions.

NIST/SEMATECH, e-Handbook of Statistical Methods (doi:10.18434/M32189), 6.3.2.2 to 6.3.2.4, whose examples are the tests.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bench.figures import Array

D2 = 1.128  # mean range of two normal values over their standard deviation, as ISO 7870-2 and the handbook print it
WIDTH = 3.0  # of the limits, in standard deviations


@dataclass(frozen=True, slots=True)
class Limits:
    """An individuals chart, in the values' unit: centre, the standard deviation that the moving range gives, control limits."""

    centre: float
    moving_range: float
    sigma: float
    lower: float
    upper: float

    @property
    def half(self) -> float:
        """From the centre to a limit."""
        return self.upper - self.centre


def individuals(values: Array) -> Limits:
    """Individuals chart of `values` (n,): mean -+ 3 MR/d2, MR the mean of |x_i - x_i-1| (handbook, 6.3.2.2).

    Differences of neighbours hold little of a slow drift and nothing of what all values have in common.

    Raises:
        ValueError: fewer than two values.
    """
    if values.size < 2:
        raise ValueError(f"found {values.size} value; expected at least two")
    centre, moving = float(np.mean(values)), float(np.mean(np.abs(np.diff(values))))
    sigma = moving / D2
    return Limits(centre, moving, sigma, centre - WIDTH * sigma, centre + WIDTH * sigma)


def ewma(values: Array, weight: float, start: float) -> Array:
    """Exponentially weighted moving average (n,): z_i = weight x_i + (1 - weight) z_i-1 from z_0 = `start`
    (Roberts 1959; handbook, 6.3.2.4)."""
    out = np.empty(values.size)
    last = start
    for k, x in enumerate(values):
        last = out[k] = weight * float(x) + (1 - weight) * last
    return out


def ewma_sigmas(weight: float, count: int) -> Array:
    """Standard deviations (count,) of z_1, z_2, … over that of a value:
    sqrt(weight / (2 - weight) (1 - (1 - weight)^2i)) (Lucas and Saccucci, Technometrics 32, 1 (1990), eq. 2)."""
    steps = np.arange(1, count + 1, dtype=np.float64)
    return ewma_settled(weight) * np.sqrt(1 - (1 - weight) ** (2 * steps))


def ewma_settled(weight: float) -> float:
    """What `ewma_sigmas` tends to: sqrt(weight / (2 - weight))."""
    return math.sqrt(weight / (2 - weight))


def cusum(values: Array, target: float, allowance: float) -> tuple[Array, Array]:
    """Sums (n,) of what exceeds `target` by more than `allowance`, up and down, never below zero: S_i = max(0, S_i-1 + x_i -
    target - allowance), and the same of target - x_i (Page 1954; handbook, 6.3.2.3)."""
    up, down = np.empty(values.size), np.empty(values.size)
    high = low = 0.0
    for k, x in enumerate(values):
        high = up[k] = max(0.0, high + float(x) - target - allowance)
        low = down[k] = max(0.0, low + target - float(x) - allowance)
    return up, down
