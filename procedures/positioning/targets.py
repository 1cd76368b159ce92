"""Where an axis is sent and in which order: targets of ISO 230-2, off whole counts of its encoder, in the standard test cycle.

    P_i = low + (i + r_i) p,     p = travel/m,     r_i within the middle of its interval, at random

and P_i/count - floor(P_i/count) takes m values that are spread evenly over a count, in a random order: half of a count that is
lost or gained shows, and so does what repeats with a pole's or a scale's period.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
MIDDLE = 0.6  # of each interval, in which its target may lie
SQUARE = math.pi / 2
NEAR_SQUARE = math.radians(2.0)  # off multiples of 90 degrees
ON_COUNT = 0.02  # of a count: so near to a whole one is on it
UP, DOWN = 1, -1


@dataclass(frozen=True)
class Approach:
    """Number `repeat` of those to target `target`, `way` UP from below or DOWN from above; `place` m or rad."""

    target: int
    way: int
    repeat: int
    place: float


def fewest(unit: str, travel: float) -> int:
    """Targets that ISO 230-2 asks for at least: 5, and 5 a metre, on a linear axis up to 2 m; on a rotary one 3 up to 90
    degrees, 5 up to 180, 8 beyond."""
    if unit == "m":
        return max(5, math.ceil(5 * travel - 1e-9))
    return next((n for most, n in ((SQUARE, 3), (2 * SQUARE, 5)) if travel <= most * (1 + 1e-9)), 8)


def targets(low: float, high: float, count: int, pitch: float, draw: int, *, turns: bool) -> Array:
    """`count` targets from `low` to `high`; `pitch` of a count, 0: not known. `turns`: off multiples of 90 degrees."""
    r = np.random.default_rng([draw, count])
    step = (high - low) / count
    at = low + (np.arange(count) + 0.5 + MIDDLE * (r.random(count) - 0.5)) * step
    if turns:
        off = (at + SQUARE / 2) % SQUARE - SQUARE / 2
        at = np.where(np.abs(off) < NEAR_SQUARE, at - off + np.where(off < 0, -1, 1) * NEAR_SQUARE, at)
    if pitch:
        part = (r.permutation(count) + 0.5) / count
        at = (np.floor(at / pitch) + part) * pitch
    return np.asarray(at)


def on_counts(at: Sequence[float] | Array, pitch: float) -> int:
    """How many targets are whole counts."""
    parts = np.asarray(at) / pitch if pitch else np.full(len(at), 0.5)
    return int((np.abs(parts - np.round(parts)) < ON_COUNT).sum())


def cycle(at: Sequence[float] | Array, repeats: int) -> Iterator[Approach]:
    """The standard test cycle: from the first target to the last one, each from below, and back, each from above; again and
    again. Before each way the axis goes beyond its first target, which is no approach."""
    places = [float(p) for p in at]
    for repeat in range(repeats):
        for way in (UP, DOWN):
            order = range(len(places)) if way == UP else range(len(places) - 1, -1, -1)
            yield from (Approach(k, way, repeat, places[k]) for k in order)
