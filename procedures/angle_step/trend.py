"""How far steps of one way are off the trend that they follow.

The integrator of the angle learns by a share of what is left in each step, and where the rotor stands before one is much what
the step before has made of it: values go on as a + b r^k, with r the same both ways. Where it stands at another edge of its
encoder before one step than before the next, they begin a count apart: a + b r^k + c start, with c the same both ways. The
first of a case begins where another case has left the rotor, and belongs to no trend; nor does one whose start no edge tells.
What the others are off it is noise, of the reading and of the machine.
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
ELSEWHERE = 0.5  # of a count between starts: another edge
FEW = 2  # degrees of freedom, that a start's effect is not read from fewer


def noise(
    ways: Sequence[Sequence[float]], starts: Sequence[Sequence[float]] | None = None, effect: float = 0.0
) -> tuple[float, int]:
    """The standard deviation of a step about the trend of its way, and its degrees of freedom. `starts` counts, of each step;
    NaN: no edge tells. `effect` of a count, as a loop has it that is linear: where there are too few steps to read it. Two
    steps show no trend, and with three or four it is a line."""
    least = min(len(way) for way in ways)
    parts = [np.asarray(way, float) for way in ways]
    if least == 2:
        dof = sum(len(p) - 1 for p in parts)
        return math.sqrt(sum(float(((p - p.mean()) ** 2).sum()) for p in parts) / dof), dof
    begun = [np.zeros(len(p)) for p in parts] if starts is None else [np.asarray(s, float) for s in starts]
    after = [np.arange(len(p)) >= (1 if least >= FIRST else 0) for p in parts]
    kept = [a & np.isfinite(s) for a, s in zip(after, begun, strict=True)]
    rates = RATES if least >= WHOLE else LINE
    numbers = 4 + (least >= WHOLE)
    elsewhere = any(np.ptp(s[k]) > ELSEWHERE for s, k in zip(begun, kept, strict=True) if k.any())
    steps = sum(int(k.sum()) for k in kept)
    if steps - numbers - elsewhere >= FEW:
        return _about(parts, begun if elsewhere else None, kept, rates, steps - numbers - elsewhere)
    parts = [p - effect * s for p, s in zip(parts, begun, strict=True)]
    if steps - numbers >= FEW:
        return _about(parts, None, kept, rates, steps - numbers)
    parts = [np.asarray(way, float) for way in ways]
    return _about(parts, None, after, rates, sum(int(a.sum()) for a in after) - numbers)


def _about(
    parts: Sequence[Array], begun: Sequence[Array] | None, kept: Sequence[npt.NDArray[np.bool_]], rates: Array, dof: int
) -> tuple[float, int]:
    return math.sqrt(min(_left(parts, begun, kept, float(rate)) for rate in rates) / dof), dof


def _left(
    parts: Sequence[Array], begun: Sequence[Array] | None, kept: Sequence[npt.NDArray[np.bool_]], rate: float
) -> float:
    """The sum of the squares of what a + b rate^k + c start leaves, with a and b of each way."""
    rows = []
    for way, k in enumerate(kept):
        shape = np.zeros((len(k), 2 * len(parts) + 1))
        shape[:, 2 * way], shape[:, 2 * way + 1] = 1.0, rate ** np.arange(len(k))
        if begun is not None:
            shape[:, -1] = begun[way]
        rows.append(shape[k])
    shapes, values = np.concatenate(rows), np.concatenate([p[k] for p, k in zip(parts, kept, strict=True)])
    numbers = np.linalg.lstsq(shapes, values, rcond=None)[0]
    return float(((values - shapes @ numbers) ** 2).sum())
