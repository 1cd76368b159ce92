"""The orbit of a shaft's centre: the ellipse of the synchronous part, the greatest distance of the raw one, contact.

With z = x + i y = F exp(j theta) + B exp(-j theta), F = (X + j Y)/2 and conj(B) = (X - j Y)/2: the half axes are
abs(F) + abs(B) and abs(F) - abs(B), the major one inclined by (arg F + arg B)/2 from x towards y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.analysis.sampling import Array, rows
from bench.analysis.vectors import Vectors, complexes, propagated
from bench.errors import AnalysisError


@dataclass(frozen=True)
class Ellipse:
    """The synchronous orbit. Half axes `major` and `minor` (negative where the precession is backward), m; `inclination` of
    the major one from x towards y, rad in [0, pi); radii `forward` and `backward`; `mark`, where the centre is as the
    once-per-turn mark passes, x + i y; `covariance` (5, 5) of the first five, in that order."""

    major: float
    minor: float
    inclination: float
    forward: float
    backward: float
    mark: complex
    covariance: Array
    dof: float

    @property
    def precession(self) -> str:
        """ "forward" with the rotation, "backward" against it, "line" where the minor axis is lost in its uncertainty."""
        if abs(self.minor) < 2 * math.sqrt(max(self.covariance[1, 1], 0.0)):
            return "line"
        return "forward" if self.minor > 0 else "backward"

    def path(self, count: int = 181) -> tuple[Array, Array]:
        """x, y (count,) over a turn, from the mark on, in the direction of motion."""
        theta = np.linspace(0, 2 * math.pi, count)
        axis = np.exp(1j * self.inclination)
        start = self.mark / axis
        phase = math.atan2(
            start.imag / self.minor if self.minor else 0.0, start.real / self.major if self.major else 1.0
        )
        z = axis * (self.major * np.cos(theta + phase) + 1j * self.minor * np.sin(theta + phase))
        return z.real, z.imag


def ellipse(vectors: Vectors, x_to_y: bool = True) -> Ellipse:
    """From the joint vectors of x and y, at one order. `x_to_y` False where the rotation goes from y to x.

    Raises:
        AnalysisError: not two vectors.
    """
    if len(vectors.values) != 2:
        raise AnalysisError(f"orbit: found {len(vectors.values)} vectors; expected those of x and y")
    way = 1.0 if x_to_y else -1.0
    about = _axes(vectors.parts, way)[2]

    def model(p: Array) -> Array:
        out = _axes(p, way)
        out[2] = about + math.remainder(out[2] - about, math.pi)  # no jump by half a turn among neighbours
        return out

    values, covariance = propagated(model, vectors.parts, vectors.covariance)
    major, minor, inclination, forward, backward = (float(v) for v in values)
    z = vectors.values
    mark = complex(z[0].real, z[1].real)
    return Ellipse(major, minor, inclination % math.pi, forward, backward, mark, covariance, vectors.dof)


def _axes(p: Array, way: float) -> Array:
    x, y = complexes(p)
    forward, backward = (x + 1j * way * y) / 2, np.conj(x - 1j * way * y) / 2
    incline = way * (np.angle(forward) + np.angle(backward)) / 2
    f, b = abs(forward), abs(backward)
    return np.array([f + b, f - b, incline, f, b])


@dataclass(frozen=True)
class Reach:
    """The greatest distance `d_max` m of the raw orbit from the clearance's centre (ISO 14839-2), the sample `at` which it is
    reached, its `share` of the clearance; `touched`, samples at or beyond the clearance."""

    d_max: float
    at: int
    share: float
    touched: int

    @property
    def contact(self) -> bool:
        """The shaft was at its ring."""
        return self.touched > 0


def reach(x: npt.ArrayLike, y: npt.ArrayLike, clearance: float, centre: tuple[float, float] = (0.0, 0.0)) -> Reach:
    """Of an orbit's samples (n,), static offset included: D_max = max over t of hypot(x, y), from the clearance's `centre`.

    The true peak between samples may be greater: by at most 1 - cos(pi f/rate) of the amplitude of the highest frequency f.

    Raises:
        AnalysisError: the clearance is not positive.
    """
    if not clearance > 0:
        raise AnalysisError(f"orbit: found a clearance of {clearance} m; expected more than 0")
    both = rows(np.array([np.asarray(x, np.float64), np.asarray(y, np.float64)]))
    radius = np.hypot(both[0] - centre[0], both[1] - centre[1])
    at = int(np.argmax(radius))
    return Reach(float(radius[at]), at, float(radius[at] / clearance), int((radius >= clearance).sum()))
