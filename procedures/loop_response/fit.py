"""The bare model: a line in a record of whole periods, and where a curve of lines crosses -3 dB or is greatest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.shared.leastsquares import Fit, linear

Array = npt.NDArray[np.float64]
HALF = math.sqrt(0.5)
BESIDE = 12  # bins on either side of a line that tell its noise
LEVEL = math.log(HALF)


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

    The noise of the line is what its neighbours among the bins have (a straight line is taken away before, for what drifts
    leaks into the lowest ones); harmonics are none of them.

    Raises:
        AnalysisError: too few periods, or |S| without the wave.
    """
    values = np.asarray(y, np.float64)
    n = values.size
    t = np.arange(n) - (n - 1) / 2
    values = values - values.mean() - t * (t @ values) / (t @ t)
    if periods < 4 or n < 4 * periods:
        raise AnalysisError(f"line: found {periods} periods in {n} samples; expected 4 or more, of 4 samples at least")
    bins = np.arange(max(2, periods - BESIDE), min(periods + BESIDE + 1, n // 2))
    bins = bins[bins % periods != 0]
    spectrum = np.fft.rfft(values) * 2 / n
    noise = float(np.mean(np.abs(spectrum[bins]) ** 2)) / 2
    found, of_wave = complex(spectrum[periods]), math.nan
    if wave is not None:
        phasor = complex(np.fft.rfft(np.asarray(wave, np.float64))[periods] * 2 / n)
        of_wave = abs(phasor)
        found = found / (phasor / of_wave) if of_wave else found
    if sensed and wave is None:
        raise AnalysisError("line: |S| needs the phase of what was added to the reading; found no wave")
    size = abs(1 + found / amplitude) if sensed else abs(found) / amplitude
    rms = math.sqrt(max(float(np.mean(values**2)) - abs(found) ** 2 / 2, 0.0))
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


def parabola(hz: npt.ArrayLike, size: npt.ArrayLike, u: npt.ArrayLike) -> tuple[Fit, float]:
    """ln(size) as a parabola in ln(hz/centre), with the centre, Hz; `hz`, `size` and its `u` are (m,).

    Raises:
        AnalysisError: fewer than four lines.
    """
    f, s, w = (np.asarray(a, np.float64) for a in (hz, size, u))
    if f.size < 4:
        raise AnalysisError(f"parabola: found {f.size} lines; expected four or more")
    centre = float(np.exp(np.log(f).mean()))
    return linear(np.vander(np.log(f / centre), 3, increasing=True), np.log(s), (w / s) ** 2), centre


def crossing(hz: npt.ArrayLike, size: npt.ArrayLike, u: npt.ArrayLike) -> Point:
    """Where the curve falls through -3 dB, 1/sqrt(2), within its lines or at most as far again beyond them.

    Raises:
        AnalysisError: it does not.
    """
    fit, centre = parabola(hz, size, u)
    a, b, c = fit.terms
    reach = 2 * float(np.abs(np.log(np.asarray(hz) / centre)).max())
    roots = np.roots([c, b, a - LEVEL])
    falls = [float(x.real) for x in roots if abs(x.imag) < 1e-12 and abs(x) < reach and b + 2 * c * x.real < 0]
    if not falls:
        raise AnalysisError("the response does not fall through -3 dB among the lines about it")
    x = falls[0]
    terms = np.array([1.0, x, x * x])
    return Point(centre * math.exp(x), HALF, fit, -terms / (b + 2 * c * x), np.zeros(3))


def summit(hz: npt.ArrayLike, size: npt.ArrayLike, u: npt.ArrayLike) -> Point:
    """The greatest of the curve.

    Raises:
        AnalysisError: it has none among its lines.
    """
    fit, centre = parabola(hz, size, u)
    a, b, c = fit.terms
    x = -b / (2 * c) if c < 0 else math.inf
    if not abs(x) <= float(np.abs(np.log(np.asarray(hz) / centre)).max()):
        raise AnalysisError("the sensitivity has no maximum among the lines about it")
    top = np.array([1.0, x, x * x])
    return Point(centre * math.exp(x), math.exp(a + b * x + c * x * x), fit, np.array([0.0, -1, -2 * x]) / (2 * c), top)


def falls_at(gain: Callable[[Array], Array], low: float, high: float) -> float:
    """The last frequency between two, Hz, at which a curve falls through -3 dB; NaN where it does not."""
    hz = np.geomspace(low, high, 20001)
    above = np.flatnonzero(gain(hz) >= HALF)
    if not above.size or above[-1] + 1 == hz.size:
        return math.nan
    k = int(above[-1])
    one, other = np.log(gain(hz[k : k + 2]))
    return float(hz[k] * (hz[k + 1] / hz[k]) ** ((one - LEVEL) / (one - other)))
