"""Complex values with their joint uncertainty: vectors of vibration, lines of a response."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.analysis.sampling import Array, Complex, lag_deg
from bench.errors import AnalysisError
from bench.uncertainty import Estimate, Influence


@dataclass(frozen=True)
class Vectors:
    """Complex `values` (m,) and the `covariance` (2m, 2m) of their parts in the order re, im, re, im; `dof` of it."""

    values: Complex
    covariance: Array
    dof: float = math.inf

    def __post_init__(self) -> None:
        m = len(self.values)
        if self.covariance.shape != (2 * m, 2 * m):
            raise AnalysisError(f"vectors: found covariance {self.covariance.shape}; expected {(2 * m, 2 * m)}")

    @property
    def parts(self) -> Array:
        """(2m,): re, im, re, im."""
        return parts(self.values)

    @property
    def amplitude(self) -> Array:
        """Zero to peak, (m,)."""
        return np.asarray(np.abs(self.values))

    @property
    def lag_deg(self) -> Array:
        """Phase lag, degrees in [0, 360), (m,)."""
        return np.asarray(lag_deg(self.values))

    @property
    def u_amplitude(self) -> Array:
        """Standard uncertainty of the amplitudes, (m,): along each vector."""
        return self._along(self.values)

    def _along(self, direction: Complex) -> Array:
        unit = np.where(np.abs(direction) > 0, direction / np.maximum(np.abs(direction), 1e-300), 1.0)
        pairs = parts(unit).reshape(-1, 2)
        blocks = np.array([self.covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(len(self.values))])
        return np.asarray(np.sqrt(np.maximum(np.einsum("ki,kij,kj->k", pairs, blocks, pairs), 0.0)))

    def one(self, k: int) -> Vectors:
        """The k-th value alone."""
        at = slice(2 * k, 2 * k + 2)
        return Vectors(self.values[k : k + 1], self.covariance[at, at], self.dof)

    def scaled(self, factor: complex | npt.ArrayLike) -> Vectors:
        """Times exact complex factors, one or (m,)."""
        f = np.broadcast_to(np.asarray(factor, np.complex128), self.values.shape)
        turn = np.zeros_like(self.covariance)
        for k, z in enumerate(f):
            turn[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[z.real, -z.imag], [z.imag, z.real]]
        return Vectors(self.values * f, turn @ self.covariance @ turn.T, self.dof)

    def minus(self, other: Vectors) -> Vectors:
        """The difference to independent vectors; degrees of freedom by Welch and Satterthwaite on the traces."""
        return Vectors(self.values - other.values, self.covariance + other.covariance, _pooled(self, other))


def _pooled(a: Vectors, b: Vectors) -> float:
    u, v = float(np.trace(a.covariance)), float(np.trace(b.covariance))
    inverse = (u**2 / a.dof + v**2 / b.dof) / (u + v) ** 2 if u + v > 0 else 0.0
    return 1 / inverse if inverse > 0 else math.inf


def parts(values: npt.ArrayLike) -> Array:
    """Real and imaginary parts in turn, (..., m) to (..., 2m)."""
    z = np.ascontiguousarray(values, np.complex128)
    return z.view(np.float64)


def complexes(pairs: npt.ArrayLike) -> Complex:
    """The inverse of `parts`."""
    return np.ascontiguousarray(pairs, np.float64).view(np.complex128)


def radius2(dof: float, probability: float = 0.95) -> float:
    """Squared Mahalanobis radius of a vector's region: Hotelling's 2 nu/(nu - 1) F(2, nu - 1); 5.99 (k = 2.45) where the
    covariance is known."""
    from scipy.special import fdtri

    if math.isinf(dof):
        return -2 * math.log(1 - probability)
    if dof <= 1:
        raise AnalysisError(f"a vector's region: found {dof} degrees of freedom; expected more than 1")
    return 2 * dof / (dof - 1) * float(fdtri(2, dof - 1, probability))


def contains(vector: Vectors, truth: complex, probability: float = 0.95) -> bool:
    """Whether the region of a single vector holds a value."""
    away = vector.parts[:2] - parts([truth])
    return bool(away @ np.linalg.solve(vector.covariance[:2, :2], away) <= radius2(vector.dof, probability))


def region(vector: Vectors, count: int = 73, probability: float = 0.95) -> Complex:
    """Outline (count,) of the region of a single vector, for figures."""
    root = np.linalg.cholesky(vector.covariance[:2, :2] + 1e-300 * np.eye(2))
    turn = np.linspace(0, 2 * math.pi, count)
    xy = math.sqrt(radius2(vector.dof, probability)) * root @ np.array([np.cos(turn), np.sin(turn)])
    out: Complex = vector.values[0] + xy[0] + 1j * xy[1]
    return out


def propagated(model: Callable[[Array], Array], at: Array, covariance: Array) -> tuple[Array, Array]:
    """Values (q,) of `model` at `at` (p,) and their covariance (q, q), by central differences (GUM 5.1.3)."""
    centre = np.asarray(model(at), np.float64)
    steps = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    slopes = np.zeros((centre.size, at.size))
    for k, step in enumerate(steps):
        if step > 0:
            move = np.zeros_like(at)
            move[k] = step
            slopes[:, k] = (model(at + move) - model(at - move)) / (2 * step)
    return centre, slopes @ covariance @ slopes.T


def estimates(
    values: npt.ArrayLike, covariance: Array, identity: str, name: str, unit: str, dof: float = math.inf
) -> list[Estimate]:
    """Values (q,) with a joint covariance as Estimates that share as many influences, `<identity>/k` (Cholesky)."""
    v = np.asarray(values, np.float64)
    u = np.sqrt(np.diag(covariance))
    scale = np.where(u > 0, u, 1.0)
    root = np.linalg.cholesky(covariance / np.outer(scale, scale) + 1e-12 * np.eye(len(u)))
    shared = [Influence(f"{identity}/{k}", name, 1.0, "1", "A", "normal", dof, "scatter") for k in range(len(u))]
    return [
        Estimate(float(v[k]), unit, {shared[j]: float(scale[k] * root[k, j]) for j in range(k + 1) if u[k] > 0})
        for k in range(len(u))
    ]


def stacked(vectors: Sequence[Vectors]) -> Vectors:
    """Independent vectors side by side; the least of their degrees of freedom."""
    values = np.concatenate([v.values for v in vectors])
    covariance = np.zeros((2 * values.size, 2 * values.size))
    at = 0
    for v in vectors:
        end = at + 2 * len(v.values)
        covariance[at:end, at:end] = v.covariance
        at = end
    return Vectors(values, covariance, min(v.dof for v in vectors))
