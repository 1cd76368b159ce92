"""A sine in sampled data: fits of known frequency (linear) and of unknown frequency (IEEE Std 1057, annexes A and B).

y = A cos(2 pi f t) + B sin(2 pi f t) + C. Amplitude and phase are of the form C + amplitude * sin(2 pi f t + phase).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.shared.leastsquares import Fit, linear

Array = npt.NDArray[np.float64]
ITERATIONS = 50


@dataclass(frozen=True)
class Sine:
    """A fitted sine: `hz`, `amplitude` (0 or more), `phase` rad, `offset`, `rms` of the residuals; `fit` has the terms
    cosine, sine, offset (and, of unknown frequency, rad/s of correction) with their covariance."""

    hz: float
    amplitude: float
    phase: float
    offset: float
    rms: float
    fit: Fit

    def at(self, t: npt.ArrayLike) -> Array:
        """Fitted values at times in s."""
        out: Array = self.offset + self.amplitude * np.sin(2 * np.pi * self.hz * np.asarray(t) + self.phase)
        return out

    @property
    def u_amplitude(self) -> float:
        """Standard uncertainty of the amplitude from the residuals, taken as white."""
        return self._spread(np.array(self.fit.terms[:2]) / max(self.amplitude, 1e-300))

    def _spread(self, slope: Array) -> float:
        return math.sqrt(max(float(slope @ self.fit.covariance[:2, :2] @ slope), 0.0))


def known_frequency(t: npt.ArrayLike, y: npt.ArrayLike, hz: float) -> Sine:
    """Three-parameter fit of samples `y` (n,) at times `t` (n,) s, not necessarily equally spaced.

    Raises:
        AnalysisError: fewer than four samples, or samples that do not determine a sine of that frequency.
    """
    time, values = np.asarray(t, np.float64), np.asarray(y, np.float64)
    if not (math.isfinite(hz) and hz > 0):
        raise AnalysisError(f"sine fit: found a frequency of {hz} Hz; expected one above 0")
    turn = 2 * np.pi * hz * time
    return _sine(hz, linear(np.column_stack([np.cos(turn), np.sin(turn), np.ones_like(turn)]), values))


def unknown_frequency(t: npt.ArrayLike, y: npt.ArrayLike, hz: float | None = None) -> Sine:
    """Four-parameter fit: `hz` is a first guess, by default the tallest line of the spectrum (equally spaced samples).

    Gauss and Newton's steps on the frequency, each a linear fit with the column -A t sin + B t cos (annex B).

    Raises:
        AnalysisError: fewer than five samples, less than a period, or no convergence.
    """
    time, values = np.asarray(t, np.float64), np.asarray(y, np.float64)
    if len(time) < 5 or time.shape != values.shape:
        raise AnalysisError(
            f"sine fit: found {time.shape} times and {values.shape} values; expected five or more of each"
        )
    middle = time - time.mean()  # a frequency far from its time's origin would turn every phase
    found = known_frequency(middle, values, _tallest(middle, values) if hz is None else hz)
    length = float(np.ptp(time)) * len(time) / (len(time) - 1)
    omega = 2 * math.pi * found.hz
    for _ in range(ITERATIONS):
        a, b = found.fit.terms[:2]
        c, s = np.cos(omega * middle), np.sin(omega * middle)
        fit = linear(np.column_stack([c, s, np.ones_like(c), middle * (b * c - a * s)]), values)
        change = float(np.clip(fit.terms[3], -1 / length, 1 / length))
        omega += change
        if not omega > 0:
            break
        found = _sine(omega / (2 * math.pi), fit)
        if abs(change) < 1e-9 * omega:
            turn = omega * time.mean()
            return Sine(
                found.hz, found.amplitude, math.remainder(found.phase - turn, 2 * math.pi), found.offset, found.rms, fit
            )
    raise AnalysisError("sine fit: the frequency does not converge")


def _tallest(t: Array, y: Array) -> float:
    """Frequency of the tallest line of the spectrum, on a grid four times as fine as that of the record."""
    size = 4 * len(y)
    lines = np.abs(np.fft.rfft((y - y.mean()) * np.hanning(len(y)), size))
    return float(max(1, int(np.argmax(lines[1:])) + 1) / (size * (t[-1] - t[0]) / (len(t) - 1)))


def _sine(hz: float, fit: Fit) -> Sine:
    a, b, c = (float(x) for x in fit.terms[:3])
    return Sine(hz, math.hypot(a, b), math.atan2(a, b), c, float(np.sqrt(np.mean(fit.residuals**2))), fit)
