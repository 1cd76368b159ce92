"""Spectra of equally spaced data: amplitudes, densities, spectra against speed, and the full spectrum of an orbit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from bench.analysis.sampling import Array, Sampling, rows
from bench.analysis.tachometer import Tachometer
from bench.analysis.windows import get_window
from bench.errors import AnalysisError

Scaling = Literal["0-pk", "pk-pk", "rms"]
_FACTORS = {"0-pk": 1.0, "pk-pk": 2.0, "rms": 2.0**-0.5}
_CHUNK = 64  # segments transformed at once: their windowed copy stays in the cache


@dataclass(frozen=True)
class Spectrum:
    """Lines at `hz` (m,) and `values` (channels, m). `scaling` "0-pk", "pk-pk" or "rms" of a sine, or "density" (unit squared
    per Hz); `window` by scipy's name, `enbw_hz` its equivalent noise bandwidth; `averages` segments in each value."""

    hz: Array
    values: Array
    scaling: Scaling | Literal["density"]
    window: str
    enbw_hz: float
    averages: int


@dataclass(frozen=True)
class Waterfall:
    """Spectra in time: `t` (s,) s and `speed` (s,) rad/s of their middles, `hz` (m,), `values` (s, m) in `scaling`."""

    t: Array
    speed: Array
    hz: Array
    values: Array
    scaling: Scaling
    window: str


def amplitude(
    x: npt.ArrayLike,
    rate: float,
    *,
    segment: int | None = None,
    window: str = "hann",
    scaling: Scaling = "0-pk",
) -> Spectrum:
    """Amplitude spectrum of `x` (c, n) at `rate` Hz: a sine in the middle of a line reads its amplitude.

    Segments of `segment` samples (default all) overlap by half; their powers are averaged. The mean of each is left out.
    """
    power, hz, w, count = _averaged(x, rate, segment, window)
    peak = np.sqrt(power) * (2 / w.sum()) * _FACTORS[scaling]
    peak[:, 0] = 0.0
    if w.size % 2 == 0:
        peak[:, -1] /= 2
    return Spectrum(hz, peak, scaling, window, _enbw(w, rate), count)


def density(x: npt.ArrayLike, rate: float, *, segment: int, window: str = "hann") -> Spectrum:
    """One-sided power spectral density of `x` (c, n), unit squared per Hz, by Welch's method with half overlap."""
    power, hz, w, count = _averaged(x, rate, segment, window)
    power *= 2 / (rate * (w**2).sum())
    power[:, 0] /= 2
    if w.size % 2 == 0:
        power[:, -1] /= 2
    return Spectrum(hz, power, "density", window, _enbw(w, rate), count)


def _averaged(x: npt.ArrayLike, rate: float, segment: int | None, window: str) -> tuple[Array, Array, Array, int]:
    """Mean square of the segments' windowed transforms (c, m), Hz (m,), the window, the number of segments."""
    from scipy import fft

    data = rows(x)
    size = segment or data.shape[1]
    if not 8 <= size <= data.shape[1]:
        raise AnalysisError(
            f"spectrum: found segments of {size} in {data.shape[1]} samples; expected 8 or more, no longer"
        )
    w = get_window(window, size)
    power = np.zeros((len(data), size // 2 + 1))
    count = 0
    for k, row in enumerate(data):
        parts = np.lib.stride_tricks.sliding_window_view(row, size)[:: max(size // 2, 1)]
        count = len(parts)
        for at in range(0, count, _CHUNK):
            some = parts[at : at + _CHUNK]
            lines = fft.rfft((some - some.mean(axis=1, keepdims=True)) * w, axis=1)
            power[k] += np.einsum("sm,sm->m", lines.real, lines.real) + np.einsum("sm,sm->m", lines.imag, lines.imag)
    return power / count, fft.rfftfreq(size, 1 / rate), w, count


def _enbw(w: Array, rate: float) -> float:
    return float(rate * (w**2).sum() / w.sum() ** 2)


def waterfall(
    t: npt.ArrayLike,
    x: npt.ArrayLike,
    tacho: Tachometer,
    sampling: Sampling,
    *,
    segment: int,
    count: int = 60,
    window: str = "hann",
    scaling: Scaling = "0-pk",
) -> Waterfall:
    """Amplitude spectra of one channel (n,), `count` of them at equal steps of speed (of time where it is constant)."""
    from scipy import fft

    at, data = np.asarray(t, np.float64), rows(x, np.size(t))[0]
    rate = (at.size - 1) / float(at[-1] - at[0])
    if at.size < segment:
        raise AnalysisError(f"waterfall: found {at.size} samples; expected {segment} or more")
    starts = np.arange(0, at.size - segment + 1, max(segment // 8, 1))
    middle = at[starts] + (segment - 1) / 2 / rate
    speed = tacho.speed(middle - sampling.late)
    inside = np.isfinite(speed)
    starts, middle, speed = starts[inside], middle[inside], speed[inside]
    if not starts.size:
        raise AnalysisError("waterfall: the record has no time between pulses")
    chosen = _spread(speed, count)
    w = get_window(window, segment)
    parts = data[starts[chosen, None] + np.arange(segment)]
    lines = np.abs(fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * w, axis=1)) * 2 / w.sum() * _FACTORS[scaling]
    return Waterfall(middle[chosen], speed[chosen], fft.rfftfreq(segment, 1 / rate), lines, scaling, window)


def _spread(speed: Array, count: int) -> npt.NDArray[np.intp]:
    """Indices at about equal steps of speed over what was run through, in order of time; of time where that is little."""
    if np.ptp(speed) < 0.02 * np.abs(speed).max():
        return np.unique(np.linspace(0, speed.size - 1, min(count, speed.size)).astype(np.intp))
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(speed)))])
    return np.unique(np.searchsorted(way, np.linspace(0, way[-1], count)).clip(0, speed.size - 1))


@dataclass(frozen=True)
class FullSpectrum:
    """Radius of the circular motions of an orbit: `hz` (m,) ascending, forward above 0 and backward below; `values` (m,)."""

    hz: Array
    values: Array
    scaling: Scaling
    window: str


def full(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    rate: float,
    *,
    window: str = "hann",
    scaling: Scaling = "0-pk",
    x_to_y: bool = True,
) -> FullSpectrum:
    """Full spectrum of z = x + i y (n,); forward is with the rotation, which goes from x to y (`x_to_y` False: from y to x).

    A circle of radius r reads r (0-pk) on one side only, a straight line of amplitude a reads a/2 on both.
    """
    from scipy import fft

    both = rows(np.array([np.asarray(x, np.float64), np.asarray(y, np.float64)]))
    z = both[0] + 1j * (both[1] if x_to_y else -both[1])
    w = get_window(window, z.size)
    lines = np.abs(fft.fftshift(fft.fft((z - z.mean()) * w))) / w.sum() * _FACTORS[scaling]
    return FullSpectrum(fft.fftshift(fft.fftfreq(z.size, 1 / rate)), lines, scaling, window)
