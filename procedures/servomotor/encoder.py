"""The encoder of the shaft's angle, as its readings show it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding

Array = npt.NDArray[np.float64]
SAME = 0.01  # of a count
LEAST_RAD = 4e-6  # sixteen times what single precision makes of an angle near pi: nearer ones are the same
FEWEST = 8  # gaps between angles, that a count is read from
NEXT, FAR = 1.5, 20.0  # counts: gaps that are one, and that are looked at whether they are whole ones
WHOLE = 0.1  # of a count, that gaps are off whole ones in the median: an angle without counts has a quarter


def count_of(readings: Iterable[Array]) -> tuple[float, bool]:
    """The smallest step between angles that are told, rad, and whether all steps are whole ones of it; NaN where hardly any
    are. A rotor that comes by an edge slowly tells it, whatever it does else."""
    gaps = np.concatenate([np.diff(np.unique(angle)) for angle in readings] or [np.zeros(0)])
    gaps = gaps[gaps > LEAST_RAD]
    if len(gaps) < FEWEST:
        return math.nan, False
    least = float(np.median(gaps[gaps < NEXT * gaps.min()]))  # single precision makes single ones smaller
    near = gaps[gaps < FAR * least] / least
    return least, bool(np.median(np.abs(near - np.rint(near))) < WHOLE)


def of_counts(readings: Iterable[Array], counts: int) -> Iterator[Finding]:
    """Whether the encoder has as many `counts` a turn as the plan says; an angle that shows no counts may have any that are as
    fine as it is told."""
    count, whole = count_of(readings)
    if not math.isfinite(count):
        return
    seen, told = math.tau / count, f"encoder_counts of the plan says {counts}"
    if whole and abs(counts / seen - 1) > SAME:
        text = (f"the angle changes by steps of {count * 1e3:.4g} mrad, {seen:.0f} counts a turn; {told}: give the "
                "encoder's own number, or look at what scales its angle.")  # fmt: skip
        yield Finding("encoder-counts", text, "encoder_counts", Effect.ERROR)
    elif not whole and counts < (1 - SAME) * seen:
        text = f"the angle shows no counts, down to {count * 1e3:.2g} mrad; {told}: give {seen:.0f} or more."
        yield Finding("encoder-counts", text, "encoder_counts", Effect.ERROR)
