"""Times of pulses that are told in coarse steps, evened out over the turns around each.

A step q of the time leaves q/sqrt(12) in each pulse, so that the speed from two that follow each other is off by some q/T of a
turn's time T, and its slope by as much again over every turn: at 143 turns a second and 10 us that is 0.14 % and three times
the acceleration of a run-up, which chops its blocks and makes noise of whatever goes by their speed's slope. A parabola through
n turns has a slope that is off by q/T n^(-3/2) of a turn: n is as many as make that less than EVEN.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
EVEN = 5e-5  # of a turn: what a step of 1 us leaves at a hundred and more turns a second
FEWEST, MOST = 5, 101  # turns of a parabola: fewer leave the pulses as they are
GAPS = 1.5  # times as many turns as pulses, over which one is still drawn


def evened(times: Array, turns: Integers, step_s: float) -> Array:
    """Pulse times (m,) s of `turns` (m,), each told in steps of `step_s`: those of turns that are long beside a step as they
    are."""
    if step_s <= 0 or times.size < FEWEST:
        return times
    shares = step_s / np.gradient(times, turns)
    count = _odd(float(shares.max()), times.size)
    coarse = (shares / EVEN) ** (2 / 3) >= FEWEST
    if count < FEWEST or not coarse.any():
        return times
    first = np.clip(np.arange(times.size) - count // 2, 0, times.size - count)
    span = turns[first + count - 1] - turns[first]
    use = np.flatnonzero(coarse & (span <= GAPS * count))
    own = first[use, None] + np.arange(count)
    at = (turns[own] - turns[use, None]) / count
    design = np.stack([np.ones_like(at), at, at**2], axis=-1)
    seen = times[own] - times[use, None]
    squares = np.einsum("mki,mkj->mij", design, design)
    sums = np.einsum("mki,mk->mi", design, seen)
    out = times.copy()
    out[use] += np.linalg.solve(squares, sums[..., None])[:, 0, 0]
    return out


def _odd(share: float, most: int) -> int:
    """Pulses of a parabola, an odd number, for steps of so much of a turn."""
    wanted = min(math.ceil((share / EVEN) ** (2 / 3)), MOST, most)
    if wanted % 2:
        return int(wanted)
    return int(wanted) - 1 if wanted == most else int(wanted) + 1
