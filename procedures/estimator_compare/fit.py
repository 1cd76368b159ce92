"""The bare model: numbers of one capture. Arrays in, numbers out.

The velocity is held against the derivative of the captured position itself, taken to both sides of each sample: a windowed sinc
of +-REACH_S that ends at CUT_HZ and delays nothing. It lacks the motion above CUT_HZ; its noise is 0.05 mm/s at 0.13 um.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
CUT_HZ, REACH_S = 400.0, 0.01
OUTSTANDING = 1000.0  # times the variance without: a current that holds the disturbance
NOISE_HZ = 100.0  # above the exciter and what the feedback does
NEAR_S = 0.1  # before where the switch is expected: none yet
LATE_S = 0.4  # after it: what a request may take over a link that is busy
SURE = 8.0  # standard deviations of a quiet position: moved
EARLY_S = 5e-3  # before it is seen to move
LATER = (
    0.05,
    0.1,
)  # s after the switch: what the feedback left of the transient is gone, what the estimate is wrong by is not
WHOLE_S = 1.0  # of the integral
TURNS, TRIED = 0.05, 41  # of the exciter's frequency: how far it may be off, and how many are tried within that


def derivative(y: Array, tick_s: float) -> Array:
    """Of positions (n,) m, (n,) m/s; within REACH_S of an end it is not told (NaN)."""
    reach = round(REACH_S / tick_s)
    k = np.arange(-reach, reach + 1)
    share = 2 * CUT_HZ * tick_s
    low = share * np.sinc(share * k) * np.blackman(len(k))
    low /= low.sum()
    slope = np.gradient(low)
    slope /= -(slope * k).sum() * tick_s  # a ramp of 1 m/s is told as 1 m/s
    out = np.full(len(y), np.nan)
    out[reach : len(y) - reach] = np.convolve(y, slope, mode="valid")
    return out


def _quiet(expected: int, tick_s: float) -> int:
    """Samples in which there is no switch and no load yet, of those before where it is expected.

    Raises:
        AnalysisError: there are none.
    """
    near = round(NEAR_S / tick_s)
    if expected <= near:
        raise AnalysisError(f"lead_s: found {expected * tick_s:g} s; expected more than the {NEAR_S:g} s before a switch or "
                            "a load that are not judged")  # fmt: skip
    return expected - near


def switched_at(current: Array, y: Array, v: Array, disturbance: Array, expected: int, tick_s: float) -> int:
    """The sample from which the current holds the disturbance.

    Before it the control current is a function of position and velocity alone, by (4.20) and the inverse of the forces; after
    it the estimated disturbance is in it too. Both are fitted where there is no doubt, and the sample parts the rest best.

    Raises:
        AnalysisError: the disturbance never comes in, or there is nothing before it.
    """
    quiet, near = _quiet(expected, tick_s), round(NEAR_S / tick_s)
    a, b = y / np.abs(y).max(), v / np.abs(v).max()
    design = np.column_stack([np.ones(len(y)), a, b, a * a, a * b, a**3, a * a * b])
    sure, late = slice(0, quiet), slice(min(expected + round(LATE_S / tick_s), len(y) - near // 2), len(y))
    left = current - design @ np.linalg.lstsq(design[sure], current[sure], rcond=None)[0]
    share = float((left[late] @ disturbance[late]) / (disturbance[late] @ disturbance[late]))
    more = np.cumsum(left**2 - (left - share * disturbance) ** 2)  # by how much the second fits better so far
    if more[-1] - more.min() < OUTSTANDING * float(left[sure].var()):
        raise AnalysisError("found no change of the current; expected the compensation to come in")
    return int(np.argmin(more[: late.start])) + 1


def moved_at(y: Array, expected: int, tick_s: float) -> int:
    """The sample from which a load is counted: EARLY_S before the position leaves what it was.

    Raises:
        AnalysisError: it does not move, or there is nothing before it.
    """
    quiet = y[: _quiet(expected, tick_s)]
    far = np.flatnonzero(np.abs(y - quiet.mean()) > SURE * quiet.std())
    far = far[far >= len(quiet)]
    if not len(far):
        raise AnalysisError("the position does not move; expected a load")
    return max(int(far[0]) - round(EARLY_S / tick_s), 0)


def velocity_error(y: Array, v: Array, until: int, tick_s: float) -> float:
    """RMS of the estimate less the derivative, over the derivative's rms, before sample `until`."""
    true = derivative(y[:until], tick_s)
    inside = np.isfinite(true)
    return rms(v[:until][inside] - true[inside]) / rms(true[inside])


def exciter_hz(disturbances: Sequence[Array], near: float, tick_s: float) -> float:
    """The exciter's frequency, within TURNS of `near` Hz, of what was estimated of the disturbance, each (n,) N.

    Least squares over all of them, each with its own scatter: they have one exciter, and one of them alone would take for its
    sine what only looks like one for its few periods. The lowest of the tried frequencies, and a parabola through it.

    Raises:
        AnalysisError: it is none within TURNS.
    """
    tried = near * np.linspace(1 - TURNS, 1 + TURNS, TRIED)
    cost = np.array([sum(len(x) * np.log(rms(besides(x, hz, tick_s))) for x in disturbances) for hz in tried])
    k = int(np.argmin(cost))
    if k in (0, TRIED - 1):
        raise AnalysisError(f"found no exciter within {TURNS:.0%} of {near:g} Hz, what the controller takes it for")
    left, least, right = cost[k - 1 : k + 2]
    return float(tried[k] + (tried[1] - tried[0]) * (left - right) / (2 * (left - 2 * least + right)))


def besides(x: Array, hz: float, tick_s: float) -> Array:
    """What a disturbance (n,) N has besides a constant and a sine: what its estimate is wrong by, as far as that is not itself
    constant or at the exciter's frequency."""
    t = np.arange(len(x)) * tick_s
    design = np.column_stack([np.ones(len(x)), np.cos(2 * np.pi * hz * t), np.sin(2 * np.pi * hz * t)])
    return np.asarray(x - design @ np.linalg.lstsq(design, x, rcond=None)[0])


def later(y: Array, at: int, tick_s: float) -> float:
    """RMS of the position in the time LATER after sample `at`."""
    return rms(y[at + round(LATER[0] / tick_s) : at + round(LATER[1] / tick_s)])


def answer(y: Array, at: int, tick_s: float) -> tuple[float, float]:
    """Greatest deviation m and integral of its size m s over WHOLE_S from sample `at`, from what the position was before."""
    off = np.abs(y[at : at + round(WHOLE_S / tick_s)] - y[:at].mean())
    if len(off) < round(WHOLE_S / tick_s):
        raise AnalysisError(f"found {len(off) * tick_s:.2f} s after the load; expected {WHOLE_S:g} s")
    return float(off.max()), float(off.sum() * tick_s)


def above(v: Array, tick_s: float) -> float:
    """RMS of what a velocity (n,) m/s has above NOISE_HZ, where the body hardly moves: its noise."""
    power = np.abs(np.fft.rfft(v - v.mean())) ** 2
    hz = np.fft.rfftfreq(len(v), tick_s)
    return float(np.sqrt(2 * power[hz >= NOISE_HZ].sum())) / len(v)


def rms(x: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt((x**2).mean()))
