"""The bare numbers of readings in windows: the largest of each, what normal noise would make of it, how far the shaft goes."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
REACH = 4  # standard deviations of a Gauss window


def cut(values: Array, samples: int) -> Array:
    """Whole windows (w, samples, ...) of values (n, ...)."""
    whole = len(values) // samples
    return values[: whole * samples].reshape(whole, samples, *values.shape[1:])


def largest(readings: Array, samples: int) -> Array:
    """Of each window (w,) the largest |reading| of all channels (n, p)."""
    out: Array = np.abs(cut(readings, samples)).max(axis=(1, 2))
    return out


def normal_largest(means: Array, deviations: Array, samples: int) -> float:
    """Mean of the largest |reading| of so many independent normal ones of each channel: the integral over x of
    1 - prod_k (1 - P(|r_k| > x))^n. Of one channel without a mean and n = 4 * 8750 it is 4.31 standard deviations."""
    from scipy import special

    top = float(np.abs(means).max() + 9 * deviations.max())
    x = np.linspace(0, top, 4000)
    s = np.maximum(deviations, 1e-12)[:, None]
    beyond = special.ndtr((means[:, None] - x) / s) + special.ndtr((-means[:, None] - x) / s)
    inside = np.exp((samples * np.log1p(-np.minimum(beyond, 1 - 1e-12))).sum(axis=0))
    return float(np.trapezoid(1 - inside, x))


def excursions(
    reading: Array, current: Array, samples: int, step_s: float, smooth_s: float, pole: float, per_ampere: float
) -> Array:
    """Of each window (w,) the largest |x| + |v|/lambda about where the shaft stands: x + v/lambda grows by e^(lambda t).

    Slow motion is that of the reading under a Gauss window, which takes the converter's noise off its rate. What is faster is
    driven by the current, `per_ampere` K_B/m in m/s^2: x'' = lambda^2 x + (K_B/m) i; of its integral that part is taken which
    the window takes off the reading.
    """
    width = smooth_s / step_s
    half = math.ceil(REACH * width)
    t = np.arange(-half, half + 1)
    kernel = np.exp(-0.5 * (t / width) ** 2)
    kernel /= kernel.sum()
    moved = reading - reading.mean()
    slow = np.convolve(moved, kernel, "same")
    slow_rate = np.convolve(moved, -t / width**2 * kernel, "same") / step_s
    driven = np.cumsum(pole**2 * slow + per_ampere * (current - current.mean())) * step_s
    fast_rate = driven - np.convolve(driven, kernel, "same")
    gone = np.cumsum(fast_rate) * step_s
    fast = gone - np.convolve(gone, kernel, "same")
    far = np.abs(slow + fast) + np.abs(slow_rate + fast_rate) / pole
    far[: 2 * half] = far[-2 * half :] = 0.0  # beyond the record the window sees nothing
    out: Array = cut(far, samples).max(axis=1)
    return out
