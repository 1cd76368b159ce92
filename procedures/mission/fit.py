"""The bare model: readings with noise to the largest one without it. Arrays in, numbers out.

The largest reading of a noisy record is too large by the noise's own maximum, which grows with the number of samples. Readings
are averaged under a Gauss window, and what is left of the noise is measured where nothing moves: it is laid over the curve at
places drawn at random, and how much larger the largest becomes by it is taken off.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
DRAWS = 200
HEAVIER = 2.0  # times as wide is the window of the curve that noise is laid over
THIN = 4  # part of a window's standard deviation that a sample stands for
SEED = 18


@dataclass(frozen=True)
class Largest:
    """A largest value: as smoothed, less the `bias` by noise that is left, plus what the window takes off a curve that is
    `bent`; `u` of one record, by noise."""

    value: float
    bias: float
    u: float
    bent: float


def largest_distance(x: Array) -> float:
    """The largest |x|."""
    return float(np.abs(x).max())


def swing(x: Array) -> float:
    """Peak to peak."""
    return float(np.ptp(x))


def smoothed(x: Array, width: float) -> Array:
    """`x` (n,) under a Gauss window of so many samples' standard deviation."""
    from scipy.ndimage import gaussian_filter1d  # slow to import, and wanted by evaluation alone

    out: Array = gaussian_filter1d(np.asarray(x, np.float64), width, mode="reflect")
    return out


def without_noise(x: Array, rests: Sequence[Array], width: float, of: Callable[[Array], float]) -> Largest:
    """What `of` (a largest distance or a swing) would be of readings `x` (n,) without noise.

    Args:
        rests: readings (m,) from where nothing moves, each longer than the window.
        width: standard deviation of the Gauss window, samples.
    """
    thin = max(int(width / THIN), 1)
    fine, heavy = smoothed(x, width), smoothed(x, HEAVIER * width)
    pool = [_noise(rest, width)[::thin] for rest in rests]
    rng, curve = np.random.default_rng(SEED), heavy[::thin]
    found = np.array([of(curve + _laid(pool, len(curve), rng)) for _ in range(DRAWS)])
    bias = float(found.mean()) - of(curve)
    bent = max(of(heavy) - of(smoothed(heavy, width)), 0.0)
    return Largest(of(fine) - bias + bent, bias, float(found.std(ddof=1)), bent)


def _noise(rest: Array, width: float) -> Array:
    out = smoothed(rest, width)
    return np.asarray(out - out.mean())


def _laid(pool: Sequence[Array], count: int, rng: np.random.Generator) -> Array:
    """Noise (count,) of pieces of the pool, each from a place drawn at random and either way up."""
    out, have = [], 0
    while have < count:
        piece = pool[int(rng.integers(len(pool)))]
        begin = int(rng.integers(len(piece) // 2 + 1))
        out.append(piece[begin:] * rng.choice((-1.0, 1.0)))
        have += len(out[-1])
    joined: Array = np.concatenate(out)[:count]
    return joined
