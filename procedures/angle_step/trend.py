"""How far steps of one way are off the trend that they follow.

The integrator of the angle learns by a share of what is left in each step, and where the rotor stands before one is much what
the step before has made of it: values go on as a + b r^k, with r the same both ways. The first of a case begins where another
case has left the rotor, and belongs to no trend. What the others are off it is noise, of the reading and of the machine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
RATES = np.linspace(0.02, 0.98, 25)  # r: from what the second step has forgotten to what is all but a line
LINE = RATES[-1:]
WHOLE, FIRST = 5, 4  # steps of a way: from here on the rate is sought; from here on the first is left out


def noise(ways: Sequence[Sequence[float]]) -> tuple[float, int]:
    """The standard deviation of a step about the trend of its way, and its degrees of freedom. Two steps show no trend, and
    with three or four it is a line."""
    least = min(len(way) for way in ways)
    parts = [np.asarray(way, float)[1 if least >= FIRST else 0 :] for way in ways]
    if least == 2:
        dof = sum(len(p) - 1 for p in parts)
        return math.sqrt(sum(float(((p - p.mean()) ** 2).sum()) for p in parts) / dof), dof
    dof = sum(len(p) - 2 for p in parts) - (1 if least >= WHOLE else 0)
    rates = RATES if least >= WHOLE else LINE
    return math.sqrt(min(sum(_left(p, float(rate)) for p in parts) for rate in rates) / dof), dof


def _left(values: Array, rate: float) -> float:
    """The sum of the squares of what a + b rate^k leaves."""
    shape = np.array([np.ones(len(values)), rate ** np.arange(len(values))]).T
    numbers = np.linalg.lstsq(shape, values, rcond=None)[0]
    return float(((values - shape @ numbers) ** 2).sum())
