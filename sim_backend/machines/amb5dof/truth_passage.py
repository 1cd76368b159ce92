"""The truth of a passage through the speeds: where the amplitudes of a shaft are greatest when its speed stands.

Critical speeds and amplification factors are those of small orbits: of the same machine with a fiftieth of its unbalance and
runout. The amplitude is that of the orbit as it is.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from sim_backend.machines.amb5dof import truth_unbalance
from sim_backend.machines.amb5dof.params import AmbParams

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
SMALL = 0.02  # of the unbalance and the runout
POINTS = 60


@dataclasses.dataclass(frozen=True)
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


def curves(p: AmbParams, settings: Mapping[str, float], low: float, high: float) -> Curves:
    """Of the machine under the controller's settings (SI, by name), between two speeds in rad/s."""
    speeds = np.linspace(low, high, POINTS)
    i, o = p.unbalance
    little = dataclasses.replace(p, unbalance=(SMALL * i, SMALL * o), runout=tuple(SMALL * x for x in p.runout))
    large, small = (truth_unbalance.response(one, settings, speeds) for one in (p, little))
    return Curves(speeds, large, small)


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
