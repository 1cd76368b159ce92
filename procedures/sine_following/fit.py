"""The bare model: one axis that follows a sine, arrays in and numbers out.

A reading is r = p + q, the place and its rounding, |q| <= h, half a count. Where the reading stays the same, the place goes
from edge to edge of a count, or stands somewhere in it. The largest of the error e = r - s from the set point s is too large
by what the largest of many q adds: q is drawn for each stretch of one reading, laid over the averaged error, and what it adds
to the largest is taken off. Squares are too large by h^2/3 in the mean, which is taken off. In a weighted sum of readings a
stretch in which the place turns back has a q of its own, of variance h^2/3; one that it goes through from edge to edge has one
of 1/n of that, for n samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
NEAR = 3.0  # half counts under the largest, down to which errors may become it
AVERAGED = 21  # samples, of the error that rounding is laid over: fewer leave rounding in it, more take off its peaks
KNOWN = 0.1  # of what rounding adds: how well that is known, by the same on errors whose places were known
DRAWS = 400
SEED = 23


@dataclass(frozen=True)
class Largest:
    """The largest error to one side, m or rad, and the u that rounding leaves of it."""

    value: float
    u: float


@dataclass(frozen=True)
class Followed:
    """Of one period: the largest error ahead and behind (the reading above and below the set point), its rms, m or rad; the
    amplitude of the place over that of the set point, and how late it is, s. `u_rms`, `u_ratio` and `u_lag` are what rounding
    leaves of them."""

    ahead: Largest
    behind: Largest
    rms: float
    ratio: float
    lag: float
    u_rms: float
    u_ratio: float
    u_lag: float


def stretches(read: Array) -> tuple[npt.NDArray[np.int64], Array]:
    """Where stretches of one reading (n,) begin, and how many samples each takes from edge to edge; 1 where the place turns
    back in it, which says nothing of where in the count that was."""
    starts = np.flatnonzero(np.diff(read, prepend=read[:1] - 1.0))
    counts, steps = np.diff(starts, append=len(read)), np.sign(np.diff(read))
    between = np.append(0.0, np.append(steps[starts[1:] - 1], 0.0))  # ways into and out of each; none at either end
    through = (between[:-1] == between[1:]) & (between[:-1] != 0)
    return starts, np.where(through, counts, 1).astype(np.float64)


def largest(error: Array, read: Array, half: float) -> Largest:
    """The largest of an error (n,) upwards. A place that takes n samples from edge to edge is rounded up by all of h but for
    one n-th of a count at some sample."""
    top, (starts, through) = float(error.max()), stretches(read)
    even = np.convolve(np.pad(error, AVERAGED // 2, mode="edge"), np.full(AVERAGED, 1 / AVERAGED), "valid")
    tops = np.maximum.reduceat(even, starts)
    near = tops > tops.max() - NEAR * half
    drawn = half - 2 * half * np.random.default_rng(SEED).random((DRAWS, int(near.sum()))) / through[near]
    found = (tops[near] + drawn).max(axis=1) - tops.max()
    added, left = float(found.mean()), float(found.std(ddof=1))
    return Largest(top - added, float(np.hypot(left, KNOWN * added)))


def left_of(weights: Array, read: Array, half: float) -> float:
    """u that rounding leaves of the sum of weights times readings (n,)."""
    starts, through = stretches(read)
    return float(half / 3**0.5 * np.sqrt((np.add.reduceat(weights, starts) ** 2 / through).sum()))


def fundamental(t: Array, x: Array, period: float) -> complex:
    """Of whole periods of a signal (n,)."""
    return complex(2 * np.mean(x * np.exp(-2j * np.pi * t / period)))


def followed(t: Array, read: Array, reference: Array, period: float, pitch: float) -> Followed:
    """One period."""
    error, half, n = read - reference, pitch / 2, len(t)
    square = max(float((error**2).mean()) - half**2 / 3, 0.0)
    rms = square**0.5
    asked = fundamental(t, reference, period)
    answer = fundamental(t, read, period) / asked
    turned = np.exp(-2j * np.pi * t / period) * 2 / n / asked
    per_answer = turned * np.conj(answer) / abs(answer)  # of a reading to |answer|, and to its phase
    rate = 2 * np.pi / period
    return Followed(
        largest(error, read, half), largest(-error, read, half), rms, abs(answer), float(-np.angle(answer)) / rate,
        left_of(error / (n * rms), read, half) if rms > half else half / 3**0.5,
        left_of(per_answer.real, read, half), left_of(per_answer.imag, read, half) / (rate * abs(answer)),
    )  # fmt: skip


def off_sine(t: Array, reference: Array, period: float, amplitude: float) -> float:
    """How far set points (n,) are from a sine of that amplitude and period, in any phase, share of the amplitude."""
    found = fundamental(t, reference, period)
    shape = (found * np.exp(2j * np.pi * t / period)).real
    return max(float(np.abs(reference - shape).max()), abs(abs(found) - amplitude)) / amplitude
