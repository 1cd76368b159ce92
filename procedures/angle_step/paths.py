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
SMOOTH_S = 2.1e-3  # of the parabola that a peak is read from: keeps 99 % of one that lasts 4 ms, noise falls to a third
WIDER_S = (4.1e-3, 6.1e-3, 12.1e-3, 24.1e-3, 48.1e-3)  # of curves that drawn noise may be put on; the first to compare
FEWEST = 5  # ticks in SMOOTH_S: a parabola through three goes through each of them
KEEPS = 2.0  # times its noise: what a curve that keeps a peak's height may differ there from that of 6 ms
DRAWS = 16  # of noise
NEAR = 0.02  # of a share: nearer to one than that the planes' distance is not read from what lies between


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


def peak_of(paths: Sequence[Array], noise: float, tick: float) -> Peak:
    """Of paths (2, n) m of steps that are alike, from one moment on; `noise` m of a reading, `tick` s between them."""
    stack = np.array([path[:, : min(p.shape[1] for p in paths)] for path in paths])
    radius, towards, raised = peak_in_noise(stack.mean(axis=0), noise / math.sqrt(len(stack)), tick)
    each = smoothed(stack, ticks_of(SMOOTH_S, tick))
    others = (each.sum(axis=0) - each) / (len(each) - 1)
    return Peak(radius, towards, raised, np.hypot(others[:, 0], others[:, 1]).max(axis=1))


def levered(motor: Sequence[Array], outboard: Sequence[Array], share: float, tick: float) -> float:
    """By how much the peak of the mean path at the motor grows with the `share` that the outboard sensors have in it, m: how
    far the two planes of sensors are apart then, along it. Paths (2, n) m; a share of one is that of a motor at the sensors,
    where the inboard ones are taken for still."""
    most = min(p.shape[1] for p in motor)
    at, beside = (
        smoothed(np.mean([p[:, :most] for p in of], axis=0), ticks_of(SMOOTH_S, tick)) for of in (motor, outboard)
    )
    k = int(np.argmax(np.hypot(*at)))
    apart = (at[:, k] - beside[:, k]) / (share - 1) if abs(share - 1) > NEAR else at[:, k]
    return float(apart @ at[:, k] / max(math.hypot(*at[:, k]), 1e-300))


def slow(tick: float) -> bool:
    """Whether readings every `tick` s are too few to read a peak from."""
    return (FEWEST - 0.5) * tick > SMOOTH_S


def ticks_of(seconds: float, tick: float) -> int:
    """The odd number that lasts so long, FEWEST at least."""
    return max(2 * round((seconds / tick - 1) / 2) + 1, FEWEST)


def smoothed(x: Array, ticks: int) -> Array:
    """(..., n): each sample from a parabola through its neighbours (Savitzky and Golay)."""
    from scipy import signal

    out: Array = signal.savgol_filter(x, ticks, 2, axis=-1)
    return out


def peak_in_noise(orbit: Array, noise: float, tick: float) -> tuple[float, Array, Raised]:
    """Greatest distance off centre of a path (2, n), m, its direction (2,), and by how much noise raises it: as much as
    drawn noise raises the peak of a smoother curve. Noise on top of what was read would say too much, for where a peak
    is round, the first noise raises it less than what follows. Each draw is taken with both signs: their mean is nothing at any
    tick."""
    ticks = ticks_of(SMOOTH_S, tick)
    smooth = smoothed(orbit, ticks)
    radius = np.hypot(*smooth)
    k = int(np.argmax(radius))
    half = smoothed(np.random.default_rng(0).normal(0.0, noise, (DRAWS // 2, *orbit.shape)), ticks)
    drawn = np.concatenate([half, -half])
    by, other = (_raised(curve, drawn) for curve in _beneath(orbit, noise, tick))
    return float(radius[k]), smooth[:, k] / max(float(radius[k]), 1e-300), Raised(by, abs(by - other))


def _beneath(orbit: Array, noise: float, tick: float) -> tuple[Array, Array]:
    """The smoothest curve that keeps the height of the peak, for its own noise is taken for the peak's; and the one before."""
    first, second, *others = (ticks for s in WIDER_S if (ticks := ticks_of(s, tick)) <= orbit.shape[1])
    before, curve = smoothed(orbit, first), smoothed(orbit, second)
    loud = KEEPS * 1.5 * noise / math.sqrt(second)  # the middle of a parabola of n ticks has 9/(4 n) of their variance
    radius = np.hypot(*curve)
    for ticks in others:
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
