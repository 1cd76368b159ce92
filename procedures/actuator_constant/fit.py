"""The bare model: current over position of a mass that a motor drives against the slope of cogging, at one place.

    M x'' = K i - k x - c x'   =>   i/x = (-M w^2 + k + j w c)/K

with k = (4 pi/tau) F_c cos(4 pi x/tau) of a cogging force -F_c sin(4 pi x/tau). Loops, observers and filters of currents are in
neither side. Where the position is read `delay` later than the current, i/x is that times e^(j w delay).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.position_loops.lines import without_trend
from procedures.shared.leastsquares import Fit, linear, nonlinear

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
BESIDE = 12  # bins on either side of a line that tell its noise


@dataclass(frozen=True)
class Line:
    """At `hz`: current over position, `ratio` A/m, with the standard uncertainty `u` of either part by noise and its degrees of
    freedom; amplitudes of `position` and `current`; `rms` of what of the position is not the sine."""

    hz: float
    ratio: complex
    u: float
    dof: float
    position: float
    current: float
    rms: float


def line(hz: float, position: npt.ArrayLike, current: npt.ArrayLike, periods: int) -> Line:
    """Of readings (n,) that hold so many whole periods.

    What noise of a closed loop there is obeys the machine: it moves as the current says. So noise is what the bins beside the
    line have of current - ratio position, in which no true motion is.
    """
    x, i = (np.asarray(a, np.float64) for a in (position, current))
    (of_x, left_x), (of_i, left_i) = (without_trend(a, periods) for a in (x, i))
    ratio = of_i / of_x if of_x else complex(math.nan)
    bins = np.arange(max(2, periods - BESIDE), min(periods + BESIDE + 1, x.size // 2))
    bins = bins[bins % periods != 0]
    beside = (np.fft.rfft(left_i)[bins] - ratio * np.fft.rfft(left_x)[bins]) * 2 / x.size
    noise = math.sqrt(float(np.mean(np.abs(beside) ** 2)) / 2) / max(abs(of_x), 1e-300)
    rms = math.sqrt(float(np.mean(left_x**2)))
    return Line(hz, ratio, noise, 2.0 * bins.size, abs(of_x), abs(of_i), rms)


@dataclass(frozen=True)
class Response:
    """Fitted at a place: `inertial` M/K, A s^2/m, `slope` k/K, A/m, `damping` c/K, A s/m, `delay` s; their covariance (4, 4);
    `bend`: by which share M/K would differ if the delay were a low-pass of that time."""

    inertial: float
    slope: float
    damping: float
    delay: float
    covariance: Array
    fit: Fit
    bend: float

    def at(self, hz: npt.ArrayLike) -> Complex:
        """i/x, A/m."""
        w = 2 * np.pi * np.asarray(hz, np.float64)
        out: Complex = (-self.inertial * w**2 + self.slope + 1j * w * self.damping) * np.exp(1j * w * self.delay)
        return out


def response(hz: npt.ArrayLike, ratio: npt.ArrayLike, u: npt.ArrayLike) -> Response:
    """Fit of complex `ratio` (n,) with the standard uncertainty `u` (n,) of either part, at `hz` (n,)."""
    w = 2 * np.pi * np.asarray(hz, np.float64)
    seen, both = np.asarray(ratio, np.complex128), np.tile(np.asarray(u, np.float64), 2)
    top = float(w.max())
    start = _start(w / top, seen, both)
    found = _fitted(w / top, seen, both, start, np.exp)
    low_pass = _fitted(w / top, seen, both, start, lambda s: 1 + s)
    scale = np.array([1 / top**2, 1.0, 1 / top, 1 / top])
    inertial, slope, damping, delay = (float(x) for x in found.terms * scale)
    bend = abs(float(low_pass.terms[0] / found.terms[0]) - 1)
    return Response(inertial, slope, damping, delay, found.covariance * np.outer(scale, scale), found, bend)


def _start(v: Array, seen: Complex, u: Array) -> Array:
    """Without a delay the model is linear."""
    zero = np.zeros_like(v)
    design = np.vstack([np.column_stack([-(v**2), zero + 1, zero]), np.column_stack([zero, zero, v])])
    fit = linear(design, np.concatenate([seen.real, seen.imag]), u**2)
    return np.array([*fit.terms, 0.0])


def _fitted(v: Array, seen: Complex, u: Array, start: Array, late: Callable[[Complex], Complex]) -> Fit:
    """`late` makes of j w delay what it turns i/x by; `v` is w over its greatest."""

    def model(p: Array) -> Array:
        y = (-p[0] * v**2 + p[1] + 1j * v * p[2]) * late(1j * v * p[3])
        return np.concatenate([y.real, y.imag])

    return nonlinear(model, np.concatenate([seen.real, seen.imag]), start, u)


def shift_ratio(
    first: npt.ArrayLike, other: npt.ArrayLike, position: npt.ArrayLike, slope: float
) -> tuple[float, float, int]:
    """K_1/K_2 of two motors that hold one load: of mean currents and positions at rest, (n,) each, with `slope` k/K_1, A a unit
    of position; its standard uncertainty by the scatter, degrees of freedom.

    At rest K_1 i_1 + K_2 i_2 = k x + a constant, so i_1 - (k/K_1) x falls by K_2/K_1 of what i_2 gains.
    """
    i_1, i_2, x = (np.asarray(a, np.float64) for a in (first, other, position))
    fit = linear(np.column_stack([i_2 - i_2.mean(), np.ones_like(i_2)]), i_1 - slope * (x - x.mean()))
    fall = -float(fit.terms[0])
    return 1 / fall, float(fit.u[0]) / fall**2, fit.dof
