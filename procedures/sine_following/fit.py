"""The bare model: one axis that follows a sine, arrays in and numbers out.

A reading is r = p + q, the place and its rounding, |q| <= h, half a count. Over a period of the error e = r - s from the set
point s: the largest of e to one side is too large by 0 to h where the reading goes through many counts near it, since some
sample is rounded up then: h/2 is taken off, and h/2 is left. Where it does not, q is one number between -h and h. Squares are
too large by h^2/3 in the mean, which is taken off. What is left in a weighted sum of readings is that of stretches in which the
reading stays the same: each has a q of its own, of variance h^2/3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
SWEPT = 3  # counts near the largest, from which on some sample is rounded up


@dataclass(frozen=True)
class Largest:
    """The largest error to one side, m or rad, and by how much rounding leaves it open."""

    value: float
    by: float


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


def largest(error: Array, read: Array, half: float) -> Largest:
    """The largest of an error (n,) upwards."""
    top = float(error.max())
    near = np.unique(read[error > top - half])
    return Largest(top - half / 2, half / 2) if len(near) >= SWEPT else Largest(top, half)


def left_of(weights: Array, read: Array, half: float) -> float:
    """u that rounding leaves of the sum of weights times readings (n,): each stretch of one reading has its own."""
    starts = np.flatnonzero(np.diff(read, prepend=read[:1] - 1.0))
    return float(half / 3**0.5 * np.sqrt((np.add.reduceat(weights, starts) ** 2).sum()))


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
