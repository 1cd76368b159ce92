"""The response of a position to a step of its set point, from means over a telemetry period. All functions are pure.

A sample at t is the mean over (t - T, t]. The curve behind the samples is the derivative of a spline through their running
sum, which gives back every mean exactly. The gain from set point to position is the Fourier transform of the response's
derivative, in the place of which stand the differences of neighbouring means, freed of what a mean takes away.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import interpolate

from bench.errors import AnalysisError
from procedures.estimators.setpoint_swing import One, Swing

Array = npt.NDArray[np.float64]
FINE = 20  # points of the curve in a telemetry period
BAND_NOISE = 5.0  # of settling, at least: the largest of a record's noise stays within it
RAW_S = 8e-3  # until then the bandwidth is that of the samples, from then on of the oscillation that was fitted to them
LENGTH_S = 0.12  # of the response that makes the bandwidth
SCAN_HZ = np.arange(20.0, 480.0, 2.0)


def curve(t: Array, y: Array) -> tuple[Array, Array]:
    """Times and values of the curve of which `y` (n,) at equally spaced `t` are the means over the period before."""
    period = float(t[1] - t[0])
    edges = np.concatenate(([t[0] - period], t))
    total = np.concatenate(([0.0], np.cumsum(y) * period))
    fine = np.linspace(edges[0], edges[-1], FINE * len(y) + 1)
    return fine, np.asarray(interpolate.make_interp_spline(edges, total, 3).derivative()(fine))


def rise_time(t: Array, y: Array) -> float:
    """From 10 to 90 % of a step of one.

    Raises:
        AnalysisError: it does not get there.
    """
    fine, x = curve(t, y)
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


def settling_time(t: Array, y: Array, within: float, samples: float) -> float:
    """Until the mean over `samples` stays within the band about 1; infinite where it does not before the end."""
    off = np.abs(trailing(y, samples) - 1)
    outside = np.flatnonzero(off > within)
    if not len(outside):
        return 0.0
    last = int(outside[-1])
    if last >= len(y) - max(20, round(2 * samples)):
        return math.inf
    return float(np.interp(-within, -off[last : last + 2], t[last : last + 2]))


@dataclass(frozen=True)
class Settling:
    """Of the mean of several steps: `time` s (infinite: not within the record), the band `within`, how far leaving out one
    step moves it (`u`, jackknife), and how far noise moves the band's edge (`edge`, half width)."""

    time: float
    within: float
    u: float
    edge: float


def settling(t: Array, steps: Array, band: float, noise: float, samples: float) -> Settling:
    """Of steps (m, n) at `t` from the control's answer; `noise` is one step's. The band is five times the mean's at least: the
    largest of thousands of noisy values would leave a narrower one again and again."""
    m = len(steps)
    sigma = noise / math.sqrt(m)
    within = max(band, BAND_NOISE * sigma)
    whole = settling_time(t, steps.mean(axis=0), within, samples)
    if not math.isfinite(whole):
        return Settling(whole, within, 0.0, 0.0)
    wider = max(within, BAND_NOISE * noise / math.sqrt(m - 1))
    left = [settling_time(t, np.delete(steps, k, axis=0).mean(axis=0), wider, samples) for k in range(m)]
    edges = [settling_time(t, steps.mean(axis=0), within + k * sigma, samples) for k in (-1, 1)]
    last = float(t[-1])
    finite = np.minimum(left, last)
    u = math.sqrt((m - 1) / m * float(((finite - finite.mean()) ** 2).sum()))
    return Settling(whole, within, u, (min(edges[0], last) - min(edges[1], last)) / 2 * math.sqrt(3))


def bandwidth(steps: Sequence[One], swing: Swing) -> float:
    """Hz from where on the gain from set point to position is below 0.707, by the steps' mean; infinite beyond the scan."""
    period = float(steps[0].t[1] - steps[0].t[0])
    count = round(LENGTH_S / period)
    turns = np.exp(-2j * np.pi * period * np.outer(SCAN_HZ, np.arange(count)))
    gain = np.zeros(len(SCAN_HZ), complex)
    for s in steps:
        first = int(np.searchsorted(s.t, -2 * period))
        t = s.t[first] + period * np.arange(count)
        raw = s.both[0, first : first + count]
        y = np.where(t < RAW_S, np.append(raw, np.zeros(count - len(raw))), swing.means(t, period))
        gain += np.exp(-2j * np.pi * SCAN_HZ * t[0]) * (turns @ np.diff(y, prepend=y[0]))
    whole = np.abs(gain) / len(steps) / np.sinc(SCAN_HZ * period) ** 2
    above = np.flatnonzero(whole >= math.sqrt(0.5))
    if not len(above) or above[-1] + 1 >= len(SCAN_HZ):
        return math.inf
    k = int(above[-1])
    return float(np.interp(-math.sqrt(0.5), -whole[k : k + 2], SCAN_HZ[k : k + 2]))
