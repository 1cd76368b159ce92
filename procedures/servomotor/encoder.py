"""The encoder of the shaft's angle, as its readings show it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding

Array = npt.NDArray[np.float64]
SAME = 0.01  # of a count
LEAST_RAD = 4e-6  # what single precision makes of one angle near pi, eight times: nearer ones are the same
FEWEST = 8  # angles, that a count is read from


def count_of(readings: Iterable[Array]) -> float:
    """The smallest step between angles that are told, rad; NaN where hardly any are. A rotor that comes by an edge slowly tells
    it, whatever it does else."""
    least, many = math.inf, 0
    for angle in readings:
        told = np.unique(angle)
        gaps = np.diff(told)
        gaps = gaps[gaps > LEAST_RAD]
        many += len(gaps)
        least = min(least, float(gaps.min(initial=math.inf)))
    return least if many >= FEWEST else math.nan


def of_counts(readings: Iterable[Array], counts: int) -> Iterator[Finding]:
    """Whether the encoder has as many `counts` a turn as the plan says."""
    count = count_of(readings)
    if math.isfinite(count) and abs(count * counts / math.tau - 1) > SAME:
        found = f"{math.tau / count:.0f} counts a turn" if count > 2 * LEAST_RAD else "no counts that are seen"
        text = (f"the angle changes by steps of {count * 1e3:.4g} mrad, {found}; encoder_counts of the plan says {counts}: "
                "give the encoder's own number, or look at what scales its angle.")  # fmt: skip
        yield Finding("encoder-counts", text, "encoder_counts", Effect.ERROR)
