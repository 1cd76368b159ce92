"""What is critical of a shaft whose amplitudes are known over held speeds: curves without noise, of any machine."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
SMALL = 0.02  # of the unbalance and the runout: what small orbits are of
POINTS = 60


@dataclass(frozen=True)
class Curves:
    """Vectors (n, 4) m of the shaft's centre at `speeds` (n,) rad/s, each held: as they are, and of small orbits."""

    speeds: Array
    large: Complex
    small: Complex

    def critical(self, axis: int, near: float) -> tuple[float, float, float]:
        """Speed rad/s of the greatest amplitude of a probe next to `near`, amplitude m, amplification factor by half power;
        NaN where there is none."""
        speed, _, factor = greatest(self.speeds, self.small[:, axis], near)
        return speed, greatest(self.speeds, self.large[:, axis], near)[1], factor


def greatest(speeds: Array, values: Complex, near: float) -> tuple[float, float, float]:
    """Speed, size and factor of the greatest of a curve without noise next to `near`; NaN where there is none."""
    fine = np.linspace(speeds[0], speeds[-1], 20001)
    size = np.abs(CubicSpline(speeds, values)(fine))
    tops = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    if not tops.size:
        return math.nan, math.nan, math.nan
    k = int(min(tops, key=lambda k: abs(fine[k] - near)))
    left, right = (np.flatnonzero(part < size[k] / math.sqrt(2)) for part in (size[:k], size[k:]))
    whole = left.size and right.size
    factor = float(fine[k] / (fine[k + right[0]] - fine[left[-1]])) if whole else math.nan
    return float(fine[k]), float(size[k]), factor
