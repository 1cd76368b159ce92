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
NEXT = 1.5  # of a count: nearer are those that are one apart


def count_of(readings: Iterable[Array]) -> float:
    """The smallest step between angles that are told, rad; NaN where hardly any are. A rotor that comes by an edge slowly tells
    it, whatever it does else."""
    gaps = np.concatenate([np.diff(np.unique(angle)) for angle in readings] or [np.zeros(0)])
    gaps = gaps[gaps > LEAST_RAD]
    if len(gaps) < FEWEST:
        return math.nan
    return float(np.median(gaps[gaps < NEXT * gaps.min()]))  # single precision makes single ones smaller


def of_counts(readings: Iterable[Array], counts: int) -> Iterator[Finding]:
    """Whether the encoder has as many `counts` a turn as the plan says."""
    count = count_of(readings)
    if math.isfinite(count) and abs(count * counts / math.tau - 1) > SAME:
        found = f"{math.tau / count:.0f} counts a turn" if count > 2 * LEAST_RAD else "no counts that are seen"
        text = (f"the angle changes by steps of {count * 1e3:.4g} mrad, {found}; encoder_counts of the plan says {counts}: "
                "give the encoder's own number, or look at what scales its angle.")  # fmt: skip
        yield Finding("encoder-counts", text, "encoder_counts", Effect.ERROR)
