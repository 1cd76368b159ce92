"""How a sample came about: a mean of several readings is smaller and later than what was read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Sampling:
    """A sample of time t is the mean of `ticks` readings `tick` s apart, the last of them `behind` s before t."""

    tick: float
    ticks: int = 1
    behind: float = 0.0

    def __post_init__(self) -> None:
        if not (self.tick > 0 and self.ticks >= 1):
            raise AnalysisError(
                f"sampling: found {self.ticks} readings {self.tick} s apart; expected one or more, above 0 s"
            )

    @property
    def late(self) -> float:
        """How long before a sample's time the middle of its readings lies, s."""
        return self.behind + (self.ticks - 1) / 2 * self.tick

    def gain(self, omega: npt.ArrayLike) -> Array:
        """What is left of the amplitude of a sine of `omega` rad/s: sin(n w T/2)/(n sin(w T/2)), Dirichlet's kernel."""
        half = np.asarray(omega, np.float64) * self.tick / 2
        below = self.ticks * np.sin(half)
        zero = np.abs(below) < 1e-12
        out: Array = np.where(zero, 1.0, np.sin(self.ticks * half) / np.where(zero, 1.0, below))
        return out


def rows(x: npt.ArrayLike, count: int | None = None) -> Array:
    """Data as (channels, samples), one channel from (samples,).

    Raises:
        AnalysisError: another shape, another number of samples than `count`, or a sample that is not finite.
    """
    out = np.atleast_2d(np.asarray(x, np.float64))
    if out.ndim != 2 or out.shape[1] == 0 or (count is not None and out.shape[1] != count):
        raise AnalysisError(f"data: found shape {out.shape}; expected (channels, {count or 'samples'})")
    if not np.isfinite(out.sum()):  # one pass: a NaN or an infinity survives a sum
        raise AnalysisError("data: found samples that are not finite; expected numbers only")
    return out


def increasing(t: npt.ArrayLike, what: str) -> Array:
    """Times (n,) in s.

    Raises:
        AnalysisError: they do not increase.
    """
    out = np.asarray(t, np.float64)
    if out.ndim != 1 or out.size < 2 or not (np.diff(out) > 0).all():
        raise AnalysisError(f"{what}: found {out.shape} times that do not increase; expected two or more in order")
    return out


def lag_deg(vector: npt.ArrayLike) -> Any:
    """Phase lag of vectors, degrees in [0, 360)."""
    return np.mod(-np.degrees(np.angle(np.asarray(vector))), 360.0)
