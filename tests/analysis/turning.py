"""A shaft that turns, and what a bench would record of it, for the tests of the analysis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from bench.analysis.sampling import Sampling
from bench.analysis.tachometer import Tachometer, tachometer

Array = npt.NDArray[np.float64]
FULL = Sampling(1e-4)
TELEMETRY = Sampling(1e-4, 10, 1e-4)
"""A mean of ten readings, the last of them a tick before the sample's time."""


@dataclass(frozen=True)
class Shaft:
    """Angle `first` rad at t = 0, `speed` rad/s, `rise` rad/s2."""

    speed: float
    rise: float = 0.0
    first: float = 0.3

    def angle(self, t: npt.ArrayLike) -> Array:
        time = np.asarray(t, np.float64)
        out: Array = self.first + self.speed * time + self.rise * time**2 / 2
        return out

    def pulses(self, until: float) -> Array:
        turns = np.arange(np.ceil(self.angle(0.0) / (2 * np.pi)), np.floor(self.angle(until) / (2 * np.pi)) + 1)
        to_go = 2 * np.pi * turns - self.first
        return np.asarray(2 * to_go / (self.speed + np.sqrt(self.speed**2 + 2 * self.rise * to_go)))

    def tacho(self, until: float) -> Tachometer:
        return tachometer(self.pulses(until))


def coloured(rng: np.random.Generator, n: int, keep: float, rms: float) -> Array:
    """Noise whose neighbours repeat each other by `keep` (first order)."""
    white = rng.standard_normal(n + 1000)
    out: Array = lfilter([np.sqrt(1 - keep**2)], [1, -keep], white)[1000:] * rms
    return out
