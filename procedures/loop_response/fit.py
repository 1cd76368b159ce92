"""The bare model: a line in a record of whole periods, and where a curve of lines crosses -3 dB or is greatest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.position_loops.lines import without_trend
from procedures.shared.leastsquares import Fit, linear

Array = npt.NDArray[np.float64]
HALF = math.sqrt(0.5)
BESIDE = 12  # bins on either side of a line that tell its noise
LEVEL = math.log(HALF)
FALL_DEGREE, TOP_DEGREE = 3, 4


@dataclass(frozen=True)
class Line:
    """What a loop answers a sine: `size` |y/r| or |S| with its standard uncertainty `u` and the degrees of freedom `dof` of
    it; `wave`, the amplitude that the captured sine has as a share of what was asked for (NaN where it is not captured);
    `swing`, the reading's amplitude, and `rms` of what is not the sine, m or rad."""

    size: float
    u: float
    dof: float
    wave: float
    swing: float
    rms: float


def line(y: npt.ArrayLike, periods: int, amplitude: float, wave: npt.ArrayLike | None = None, *,
         sensed: bool = False) -> Line:  # fmt: skip
    """Of readings `y` (n,) that hold so many whole periods of a sine of that `amplitude`, `wave` (n,) as a share of it;
    `sensed`: it was added to the reading, and |S| = |y + injected|/amplitude is asked for, else |y|/amplitude.

    The noise of the line is what its neighbours among the bins have, of what is left without the sine and a straight line;
    harmonics are none of them.

    Raises:
        AnalysisError: too few periods, or |S| without the wave.
    """
    values = np.asarray(y, np.float64)
    n = values.size
    if periods < 4 or n < 4 * periods:
        raise AnalysisError(f"line: found {periods} periods in {n} samples; expected 4 or more, of 4 samples at least")
    found, left = without_trend(values, periods)
    bins = np.arange(max(2, periods - BESIDE), min(periods + BESIDE + 1, n // 2))
    bins = bins[bins % periods != 0]
    noise = float(np.mean(np.abs(np.fft.rfft(left)[bins] * 2 / n) ** 2)) / 2
    of_wave = math.nan
    if wave is not None:
        phasor, _ = without_trend(np.asarray(wave, np.float64), periods)
        of_wave = abs(phasor)
        found = found / (phasor / of_wave) if of_wave else found
    if sensed and wave is None:
        raise AnalysisError("line: |S| needs the phase of what was added to the reading; found no wave")
    size = abs(1 + found / amplitude) if sensed else abs(found) / amplitude
    rms = math.sqrt(float(np.mean(left**2)))
    return Line(size, math.sqrt(noise) / amplitude, 2.0 * bins.size, of_wave, abs(found), rms)


@dataclass(frozen=True)
class Point:
    """Of a curve: `hz` where it crosses or is greatest, `size` there; `fit` of the terms of ln(size) over ln(hz/centre), and
    the derivatives of ln(hz) and ln(size) by them, (p,) each."""

    hz: float
    size: float
    fit: Fit
    of_hz: Array
    of_size: Array


def polynomial(hz: npt.ArrayLike, size: npt.ArrayLike, u: npt.ArrayLike, degree: int) -> tuple[Fit, float]:
    """ln(size) as a polynomial in ln(hz/centre), lowest power first, with the centre, Hz; `hz`, `size` and its `u` are (m,).

    Raises:
        AnalysisError: not more lines than terms.
    """
    f, s, w = (np.asarray(a, np.float64) for a in (hz, size, u))
    if f.size <= degree + 1:
        raise AnalysisError(f"found {f.size} lines; expected more than {degree + 1}")
    centre = float(np.exp(np.log(f).mean()))
    return linear(np.vander(np.log(f / centre), degree + 1, increasing=True), np.log(s), (w / s) ** 2), centre


def crossing(hz: npt.ArrayLike, size: npt.ArrayLike, u: npt.ArrayLike) -> Point:
    """Where the curve falls through -3 dB, 1/sqrt(2), by a polynomial of degree FALL_DEGREE, among its lines.

    Raises:
        AnalysisError: it does not.
    """
    fit, centre = polynomial(hz, size, u, FALL_DEGREE)
    curve = np.polynomial.Polynomial(fit.terms)
    low, high = (float(np.log(f / centre)) for f in (np.min(hz), np.max(hz)))
    found = [complex(x) for x in (curve - LEVEL).roots()]
    falls = [x.real for x in found if abs(x.imag) < 1e-9 and low < x.real < high and curve.deriv()(x.real) < 0]
    if not falls:
        raise AnalysisError("the response does not fall through -3 dB among the lines about it")
    x = max(falls)
    powers, slope = np.array([x**k for k in range(FALL_DEGREE + 1)]), float(curve.deriv()(x))
    return Point(centre * math.exp(x), HALF, fit, -powers / slope, np.zeros(powers.size))


def summit(hz: npt.ArrayLike, size: npt.ArrayLike, u: npt.ArrayLike) -> Point:
    """The greatest of the curve, by a polynomial of degree TOP_DEGREE: about a maximum a curve is not even.

    Raises:
        AnalysisError: it has none among its lines.
    """
    fit, centre = polynomial(hz, size, u, TOP_DEGREE)
    curve = np.polynomial.Polynomial(fit.terms)
    low, high = (float(np.log(f / centre)) for f in (np.min(hz), np.max(hz)))
    found = [complex(x) for x in curve.deriv().roots()]
    tops = [x.real for x in found if abs(x.imag) < 1e-9 and low < x.real < high and curve.deriv(2)(x.real) < 0]
    if not tops:
        raise AnalysisError("the sensitivity has no maximum among the lines about it")
    x = max(tops, key=lambda at: float(curve(at)))
    powers = np.array([x**k for k in range(TOP_DEGREE + 1)])
    slopes = np.array([0.0, *(k * x ** (k - 1) for k in range(1, TOP_DEGREE + 1))])
    bend = float(curve.deriv(2)(x))
    return Point(centre * math.exp(x), math.exp(float(curve(x))), fit, -slopes / bend, powers)


def falls_at(gain: Callable[[Array], Array], low: float, high: float) -> float:
    """The last frequency between two, Hz, at which a curve falls through -3 dB; NaN where it does not."""
    hz = np.geomspace(low, high, 20001)
    above = np.flatnonzero(gain(hz) >= HALF)
    if not above.size or above[-1] + 1 == hz.size:
        return math.nan
    k = int(above[-1])
    one, other = np.log(gain(hz[k : k + 2]))
    return float(hz[k] * (hz[k + 1] / hz[k]) ** ((one - LEVEL) / (one - other)))
