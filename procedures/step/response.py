"""The response of a position to a step of its set point, from means over a telemetry period. All functions are pure.

A sample at t is the mean over (t - T, t]. The curve behind the samples is the derivative of a spline through their running
sum, which gives back every mean exactly. The gain from set point to position is the Fourier transform of the response's
derivative, in the place of which stand the differences of neighbouring means, freed of what a mean takes away.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.step.oscillation import One, Swing

Array = npt.NDArray[np.float64]
FINE = 20  # points of the curve in a telemetry period
RAW_S = 8e-3  # until then the bandwidth is that of the samples, from then on of the oscillation that was fitted to them
LENGTH_S = 0.12  # of the response that makes the bandwidth, at least
LASTS = 7.0  # time constants of its slowest oscillation: what is cut off behind them is 0.1 % of a swing
TOUCHES = 0.03  # of 0.707, that a dip may be nearer than
SCAN_HZ = np.arange(20.0, 480.0, 2.0)


def curve(t: Array, y: Array) -> tuple[Array, Array]:
    """Times and values of the curve of which `y` (n,) at equally spaced `t` are the means over the period before."""
    from scipy import interpolate

    period = float(t[1] - t[0])
    edges = np.concatenate(([t[0] - period], t))
    total = np.concatenate(([0.0], np.cumsum(y) * period))
    fine = np.linspace(edges[0], edges[-1], FINE * len(y) + 1)
    return fine, np.asarray(interpolate.make_interp_spline(edges, total, 3).derivative()(fine))


def curve_from_rest(t: Array, y: Array) -> tuple[Array, Array]:
    """The same from t = 0 on, until which what `y` (n,) are the means of rested; a reading that ends nearer than half a period
    behind it tells more noise than curve."""
    from scipy import interpolate

    period = float(t[1] - t[0])
    late = t > period / 2
    edges = np.concatenate(([0.0], t[late]))
    total = np.concatenate(([0.0], (np.cumsum(y) - y[t <= -period / 2].sum())[late] * period))
    fine = np.linspace(0.0, edges[-1], FINE * len(edges) + 1)
    spline = interpolate.make_interp_spline(edges, total, 3, bc_type=([(1, 0.0)], [(2, 0.0)]))
    return fine, np.asarray(spline.derivative()(fine))


def rise_time(fine: Array, x: Array) -> float:
    """From 10 to 90 % of a step of one, of a curve `x` (n,) at equally spaced `fine`.

    Raises:
        AnalysisError: it does not get there.
    """
    above = np.flatnonzero(x >= 0.9)
    if not len(above):
        raise AnalysisError(f"the position reaches {x.max():.0%} of the step; expected 90 % at least")
    last = int(above[0])
    below = np.flatnonzero(x[: last + 1] < 0.1)
    first = int(below[-1]) if len(below) else 0
    step = float(fine[1] - fine[0])

    def crossing(k: int, level: float) -> float:
        a, b = x[k], x[k + 1]
        return float(fine[k] + step * (level - a) / (b - a)) if b != a else float(fine[k])

    return crossing(max(last - 1, 0), 0.9) - crossing(first, 0.1)


def trailing(y: Array, samples: float) -> Array:
    """Mean over the last `samples` (a fraction of the oldest one where that is none), (n,); the first ones over fewer."""
    whole = int(samples)
    kernel = np.concatenate((np.ones(whole), [samples - whole]))
    count = np.convolve(np.ones(len(y)), kernel)[: len(y)]
    return np.asarray(np.convolve(y, kernel)[: len(y)] / count)


def bandwidth(steps: Sequence[One], swing: Swing) -> float:
    """Hz where the gain from set point to position first falls below 0.707, by the steps' mean; infinite beyond the scan. A
    bending mode far above may lift it again: that is no band in which the shaft follows. A dip that only just touches 0.707, or
    just does not, is told by noise (95 Hz for 206): then it is not a number."""
    period = float(steps[0].t[1] - steps[0].t[0])
    count = round(max(LENGTH_S, LASTS * swing.lasting) / period)
    turns = np.exp(-2j * np.pi * period * np.outer(SCAN_HZ, np.arange(count)))
    gain = np.zeros(len(SCAN_HZ), complex)
    for s in steps:
        first = int(np.searchsorted(s.t, -2 * period))
        t = s.t[first] + period * np.arange(count)
        raw = s.both[0, first : first + count]
        y = np.where(t < RAW_S, np.append(raw, np.zeros(count - len(raw))), swing.means(t, period))
        gain += np.exp(-2j * np.pi * SCAN_HZ * t[0]) * (turns @ np.diff(y, prepend=y[0]))
    whole = np.abs(gain) / len(steps) / np.sinc(SCAN_HZ * period) ** 2
    falls = np.flatnonzero((whole[:-1] >= math.sqrt(0.5)) & (whole[1:] < math.sqrt(0.5)))
    if not len(falls):
        return math.inf
    k = int(falls[0])
    again = np.flatnonzero(whole[k + 1 :] >= math.sqrt(0.5))
    dips = [whole[k + 1 : k + 1 + int(again[0])].min()] if len(again) else []
    inner = whole[1:k]
    dips += list(inner[(inner <= whole[: k - 1]) & (inner <= whole[2 : k + 1])]) if k > 1 else []
    if any(abs(x / math.sqrt(0.5) - 1) < TOUCHES for x in dips):
        return math.nan
    return float(np.interp(-math.sqrt(0.5), -whole[k : k + 2], SCAN_HZ[k : k + 2]))
