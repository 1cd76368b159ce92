"""The path of the shaft during a step, from captures: the mean of steps that are alike, and how far it goes.

One step's greatest distance holds what noise did in it, of the sensors and of the loop that follows them: a shaft that is told
a wrong place goes there, and its sensors do not show it. The mean of some steps has little of either.

How well the greatest distance of a mean is known, the means that leave one of its steps out say (jackknife): u^2 = (k - 1)/k
sum (r_j - mean r)^2. What the steps differ by at the moment of the peak would say too much. A path that stays near its greatest
distance for long, as with priority, has several places that are about as far, and the largest of n that vary by s by themselves
varies less: by 0.83 s of two, 0.75 s of three. (The jackknife of a greatest value is too great too, but by less: u of
priority's peaks is 1.1 times what signs drawn for the steps' residuals give, and was 1.35 times.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
SMOOTH = 21  # ticks of the parabola that a peak is read from: keeps 99 % of one that lasts 4 ms, noise falls to a third
WIDER = (41, 61, 121, 241, 481)  # ticks of the curves that drawn noise may be put on; of the first only to compare
KEEPS = 2.0  # times its noise: what a curve that keeps a peak's height may differ there from that of 61 ticks
DRAWS = 16  # of noise


@dataclass(frozen=True)
class Raised:
    """`by` how much noise raises a peak, m, and how far `off` that may be, m: what a curve that is smoothed less says."""

    by: float
    off: float


@dataclass(frozen=True)
class Peak:
    """The greatest distance of a mean path off centre, m, its direction (2,), by how much noise has `raised` it, and that
    distance of the mean path `without` each step, (k,) m."""

    radius: float
    towards: Array
    raised: Raised
    without: Array

    @property
    def variance(self) -> float:
        """Of the distance, by the steps, m^2."""
        return (len(self.without) - 1) * float(self.without.var())


def peak_of(paths: Sequence[Array], noise: float) -> Peak:
    """Of paths (2, n) m of steps that are alike, from one moment on; `noise` m of a reading."""
    stack = np.array([path[:, : min(p.shape[1] for p in paths)] for path in paths])
    radius, towards, raised = peak_in_noise(stack.mean(axis=0), noise / math.sqrt(len(stack)))
    each = smoothed(stack)
    others = (each.sum(axis=0) - each) / (len(each) - 1)
    return Peak(radius, towards, raised, np.hypot(others[:, 0], others[:, 1]).max(axis=1))


def smoothed(x: Array, ticks: int = SMOOTH) -> Array:
    """(..., n): each sample from a parabola through its neighbours (Savitzky and Golay)."""
    from scipy import signal

    out: Array = signal.savgol_filter(x, ticks, 2, axis=-1)
    return out


def peak_in_noise(orbit: Array, noise: float) -> tuple[float, Array, Raised]:
    """Greatest distance off centre of a path (2, n), m, its direction (2,), and by how much noise raises it: as much as
    drawn noise raises the peak of a smoother curve. Noise on top of what was read would say too much, for where a peak
    is round, the first noise raises it less than what follows. Each draw is taken with both signs: their mean is nothing at any
    tick."""
    smooth = smoothed(orbit)
    radius = np.hypot(*smooth)
    k = int(np.argmax(radius))
    half = smoothed(np.random.default_rng(0).normal(0.0, noise, (DRAWS // 2, *orbit.shape)))
    drawn = np.concatenate([half, -half])
    by, other = (_raised(curve, drawn) for curve in _beneath(orbit, noise))
    return float(radius[k]), smooth[:, k] / max(float(radius[k]), 1e-300), Raised(by, abs(by - other))


def _beneath(orbit: Array, noise: float) -> tuple[Array, Array]:
    """The smoothest curve that keeps the height of the peak, for its own noise is taken for the peak's; and the one before."""
    before, curve = (smoothed(orbit, ticks) for ticks in WIDER[:2])
    loud = (
        KEEPS * 1.5 * noise / math.sqrt(WIDER[1])
    )  # the middle of a parabola of n ticks has 9/(4 n) of their variance
    radius = np.hypot(*curve)
    for ticks in WIDER[2:]:
        wider = smoothed(orbit, ticks)
        size = np.hypot(*wider)
        k = int(np.argmax(size))
        if abs(radius[k] - size[k]) > loud:
            break
        before, curve = curve, wider
    return curve, before


def _raised(curve: Array, drawn: Array) -> float:
    """By how much noise `drawn` (DRAWS, 2, n) m raises the greatest distance of a curve (2, n) m off centre, in the mean."""
    again = curve + drawn
    return float(np.hypot(again[:, 0], again[:, 1]).max(axis=1).mean() - np.hypot(*curve).max())
