"""The response of a position to a step of its set point, from means over a telemetry period. All functions are pure.

A sample at t is the mean over (t - T, t]. The curve behind the samples is the derivative of a spline through their running
sum, which gives back every mean exactly. The bandwidth is that of a model fitted to the means: K w^2/(s^2 + 2 z w s + w^2)
/(1 + s T_f), delayed, and a straight line for what integrators do in the same time. Damping and frequency are those of the
oscillations that position and tilt share as they die away: a mean over a period scales them and leaves them as they are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import interpolate, optimize

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
FINE = 20  # points of the curve in a telemetry period
FIRST_S = 0.05  # the step's own swing: about three periods of what levitates
FROM_S = 3e-3
SCAN_HZ = np.arange(2.0, 400.0, 0.25)


@dataclass(frozen=True)
class Response:
    """What one step shows, as shares of it where lengths are meant: `rise` 10 to 90 % s, `overshoot`, `error` at
    the end, `bandwidth` Hz, `gain` of the model, `misfit` rms of the model, `shape` Hz: how far the bandwidth moves
    when the model has
    its lag twice; `model` (n,) at `model_t`."""

    rise: float
    overshoot: float
    error: float
    bandwidth: float
    gain: float
    misfit: float
    shape: float
    model_t: Array
    model: Array


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
    outside = np.flatnonzero(np.abs(trailing(y, samples) - 1) > within)
    if not len(outside):
        return 0.0
    if outside[-1] >= len(y) - max(20, round(2 * samples)):
        return math.inf
    return float(t[outside[-1] + 1])


def stepped(t: Array, period: float, w: float, z: float, lag: float, twice: bool) -> Array:
    """Means over the period before `t` of the model's answer to a unit step at 0: sum over its poles."""
    root = w * np.sqrt(complex(z * z - 1))
    lags = [-1 / lag, -1.03 / lag] if twice else [-1 / lag]
    poles = np.array([-z * w + root, -z * w - root, *lags])
    scale = w * w * np.prod([-p for p in lags])
    residues = [scale / (p * np.prod([p - q for q in poles if q is not p and q != p])) for p in poles]

    def integral(at: Array) -> Array:
        at = np.maximum(at, 0.0)
        return np.asarray(at + sum((r / p * (np.exp(p * at) - 1)).real for r, p in zip(residues, poles, strict=True)))

    return np.asarray((integral(t) - integral(t - period)) / period)


def fitted(t: Array, y: Array, twice: bool) -> tuple[Array, Array]:
    """Parameters w, z, lag, delay, K, slope of the model, and its values at `t`.

    Raises:
        AnalysisError: there is no fit.
    """
    period = float(t[1] - t[0])

    def model(t: Array, w: float, z: float, lag: float, delay: float, k: float, slope: float) -> Array:
        return k * stepped(t - delay, period, w, z, lag, twice) + slope * np.clip(t, 0, None)

    top = float(t[int(np.argmax(y))])
    over = max(float(y.max()) / max(float(np.mean(y[-10:])), 0.2) - 1, 0.02)
    z = min(max(-math.log(over) / math.hypot(math.pi, math.log(over)), 0.05), 0.9) if over < 1 else 0.05
    w = math.pi / max(top - 0.0015, 0.002) / math.sqrt(1 - z * z)
    low = [20.0, 0.01, 1e-4, -3e-3, 0.2, -20.0]
    high = [2000.0, 0.98, 6e-3, 6e-3, 4.0, 20.0]
    start = [
        min(max(w, 30.0), 1500.0),
        z,
        5e-4 if not twice else 3e-4,
        1e-3,
        min(max(float(np.mean(y[-10:])), 0.3), 3.0),
        0.0,
    ]
    try:
        found, _ = optimize.curve_fit(
            model, t, y, start, bounds=(low, high), x_scale=[100, 0.1, 1e-3, 1e-3, 1, 1], max_nfev=400
        )
    except RuntimeError as error:
        raise AnalysisError(f"no model of second order fits the response: {error}") from error
    return np.asarray(found), model(t, *found)


def bandwidth(p: Array, twice: bool) -> float:
    """Hz at which the model's gain has fallen to 0.707 of the set point, after its peak; infinite beyond the scan."""
    w, z, lag, _, k, _ = p
    s = 2j * math.pi * SCAN_HZ
    gain = np.abs(k * w * w / (s * s + 2 * z * w * s + w * w)) / np.abs(1 + s * lag) ** (2 if twice else 1)
    above = np.flatnonzero(gain >= math.sqrt(0.5))
    if not len(above) or above[-1] + 1 >= len(SCAN_HZ):
        return math.inf
    k0 = int(above[-1])
    return float(np.interp(-math.sqrt(0.5), -gain[k0 : k0 + 2], SCAN_HZ[k0 : k0 + 2]))


def _peak(p: Array, t: Array, residual: Array) -> float:
    """Greatest value: the model's, and the mean of three residuals about it. The largest of many noisy samples is too large."""
    w, z, lag, delay, k, slope = p
    fine = np.arange(0, FIRST_S, 2e-5)
    x = k * stepped(fine - delay, 1e-6, w, z, lag, False) + slope * fine
    top = int(np.argmax(x))
    at = int(np.argmin(np.abs(t - 0.5 * float(t[1] - t[0]) - fine[top])))
    return float(x[top] + residual[max(at - 1, 0) : at + 2].mean())


@dataclass(frozen=True)
class Mode:
    """An oscillation that dies away: damping ratio, natural frequency Hz, and how large it is in the response at the step."""

    damping: float
    frequency: float
    amplitude: float


def modes(t: Array, both: Array, count: int) -> Mode:
    """The strongest of `count` damped oscillations that position and tilt (2, n) share, from FROM_S after the step on, when
    filters and current loops have died away. What is linear in the model is eliminated (variable projection).

    Raises:
        AnalysisError: no oscillation fits.
    """
    near = (t > FROM_S) & (t < FIRST_S)
    t, data = t[near], both[: 1 if count == 1 else 2, near]

    def columns(p: Array) -> Array:
        parts = [np.ones_like(t), t]
        for s, w in 100 * p.reshape(-1, 2):
            parts += [np.exp(-s * t) * np.cos(w * t), np.exp(-s * t) * np.sin(w * t)]
        return np.array(parts).T

    def left(p: Array) -> Array:
        a = columns(p)
        return np.asarray((data.T - a @ np.linalg.lstsq(a, data.T, rcond=None)[0]).ravel())

    guess = _swing(t, data[0])
    start = np.array([0.22, 1.0, 0.25, 1.06])[: 2 * count] * guess / 100
    low, high = np.tile([-1.0, 0.3], count), np.tile([10.0, 20.0], count)
    found = optimize.least_squares(
        left, np.clip(start, low + 0.01, high - 0.01), bounds=(low, high), x_scale=0.1, max_nfev=200
    )
    linear = np.linalg.lstsq(columns(found.x), data[0], rcond=None)[0]
    out = [Mode(float(s / np.hypot(s, w)), float(50 * np.hypot(s, w) / np.pi), float(np.hypot(*linear[2 + 2 * k : 4 + 2 * k])))
           for k, (s, w) in enumerate(found.x.reshape(-1, 2))]  # fmt: skip
    return max(out, key=lambda m: m.amplitude)


def _swing(t: Array, y: Array) -> float:
    """Angular frequency, roughly, from the first peak to the trough after it."""
    top = int(np.argmax(y))
    rest = y[top:]
    trough = int(np.argmin(rest[: max(len(rest) // 2, 2)]))
    half = (t[top + trough] - t[top]) if trough else 0.008
    return float(np.pi / max(half, 2e-3))


@dataclass(frozen=True)
class Settling:
    """Of the mean of several steps: `time` s (infinite: not within the record), the band `within`, how far leaving out one
    step moves it (`u`, jackknife), and how far noise moves the band's edge (`edge`, half width)."""

    time: float
    within: float
    u: float
    edge: float


def settling(t: Array, steps: Array, band: float, noise: float, samples: float) -> Settling:
    """Of steps (m, n) at `t` from the control's answer; `noise` is one step's. The band is four times the mean's at least: the
    largest of thousands of noisy values would leave a narrower one again and again."""
    m = len(steps)
    sigma = noise / math.sqrt(m)
    within = max(band, 4 * sigma)
    whole = settling_time(t, steps.mean(axis=0), within, samples)
    if not math.isfinite(whole):
        return Settling(whole, within, 0.0, 0.0)
    left = [settling_time(t, np.delete(steps, k, axis=0).mean(axis=0), max(within, 4 * noise / math.sqrt(m - 1)), samples)
            for k in range(m)]  # fmt: skip
    edges = [settling_time(t, steps.mean(axis=0), within + k * sigma, samples) for k in (-1, 1)]
    last = float(t[-1])
    finite = np.minimum(left, last)
    u = math.sqrt((m - 1) / m * float(((finite - finite.mean()) ** 2).sum()))
    return Settling(whole, within, u, (min(edges[0], last) - min(edges[1], last)) / 2 * math.sqrt(3))


def response(t: Array, y: Array) -> Response:
    """Measure one step. `t` s from when the control answers, with some samples before it; `y` as a share of the step from
    its rest.

    Raises:
        AnalysisError: the position does not get to 90 % of the step, or nothing fits.
    """
    rise = rise_time(t[t < FIRST_S], y[t < FIRST_S])
    near = (t > -4e-3) & (t < FIRST_S)
    p, model = fitted(t[near], y[near], False)
    q, _ = fitted(t[near], y[near], True)
    tail = t > t[-1] - min(0.2, 0.25 * t[-1])
    wide, doubled = bandwidth(p, False), bandwidth(q, True)
    shape = abs(wide - doubled) if math.isfinite(wide + doubled) else 0.0
    return Response(
        rise=rise,
        overshoot=_peak(p, t[near], y[near] - model) - 1,
        error=float(y[tail].mean()) - 1,
        bandwidth=wide,
        gain=float(p[4]),
        misfit=float(np.sqrt(np.mean((model - y[near]) ** 2))),
        shape=shape,
        model_t=t[near],
        model=model,
    )
