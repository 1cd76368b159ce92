"""A value and its elementary influences, with arithmetic that keeps them apart by identity.

Two estimates that share an influence are correlated because they share it; no correlation is ever typed in
(GUM 5.2.4, F.1.2.3: correlations removed by making the common influences inputs of their own).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
Distribution = Literal["normal", "rectangular", "triangular", "arcsine"]
Deviations = Mapping[str, Array]  # influence id -> drawn deviations from its expectation
Sampler = Callable[[Deviations], Array]


@dataclass(frozen=True, slots=True)
class Influence:
    """One elementary influence. `id` is its identity along the whole chain; `u` its standard uncertainty in `unit`.

    `kind` is the GUM's Type A (from repeats) or B (from anything else); `dof` the degrees of freedom of `u`.

    Raises:
        AnalysisError: `u` is negative or not finite, or `dof` is not positive.
    """

    id: str
    name: str
    u: float
    unit: str
    kind: Literal["A", "B"]
    distribution: Distribution
    dof: float = math.inf
    source: str = ""

    def __hash__(self) -> int:
        return hash(
            self.id
        )  # equal influences have one id; that of all fields took a fifth of an evaluation's arithmetic

    def __post_init__(self) -> None:
        if not (math.isfinite(self.u) and self.u >= 0):
            raise AnalysisError(f"influence {self.id}: found u = {self.u}; expected a finite number, 0 or more")
        if not self.dof > 0:
            raise AnalysisError(f"influence {self.id}: found dof = {self.dof}; expected more than 0 (inf if exact)")
        if self.distribution not in ("normal", "rectangular", "triangular", "arcsine"):
            raise AnalysisError(
                f"influence {self.id}: found distribution {self.distribution!r}; "
                "expected normal, rectangular, triangular or arcsine"
            )


def _same(a: Influence, b: Influence) -> None:
    if (a.u, a.dof, a.distribution) != (b.u, b.dof, b.distribution):
        raise AnalysisError(
            f"influence {a.id}: found twice, with u {a.u}, dof {a.dof}, {a.distribution} and with "
            f"u {b.u}, dof {b.dof}, {b.distribution}; expected one identity to mean one influence"
        )


@dataclass(frozen=True)
class Estimate:
    """A value with its sensitivity (derivative) to each elementary influence.

    Arithmetic is linear propagation (GUM 5.1). Units are carried by sums and by factors, not computed.
    `sampler` is set where that is not enough (see `propagate`): it evaluates the model for drawn influences.
    """

    __array_ufunc__: ClassVar[None] = None  # a numpy number on the left leaves the arithmetic to us
    value: float
    unit: str = ""
    sensitivities: Mapping[Influence, float] = field(default_factory=dict)
    sampler: Sampler | None = field(default=None, repr=False, compare=False)

    @staticmethod
    def exact(value: float, unit: str = "") -> Estimate:
        """A value without uncertainty."""
        return Estimate(float(value), unit)

    @staticmethod
    def of(value: float, influence: Influence) -> Estimate:
        """A value that is uncertain by one influence, in its unit."""
        return Estimate(float(value), influence.unit, {influence: 1.0})

    @property
    def contributions(self) -> dict[str, float]:
        """Signed standard uncertainty contribution c_i u_i by influence id."""
        return {i.id: c * i.u for i, c in self.sensitivities.items()}

    @property
    def u(self) -> float:
        """Combined standard uncertainty (GUM eq. 10; influences are independent by construction)."""
        return math.hypot(*self.contributions.values())

    @property
    def nonlinear(self) -> bool:
        """The model is not linear over the spread of its inputs: intervals come from Monte Carlo."""
        return self.sampler is not None

    def sampled(self, deviations: Deviations) -> Array:
        """Values of the model for drawn deviations, one array per influence id, all of one length."""
        if self.sampler is not None:
            return self.sampler(deviations)
        out = np.full(len(next(iter(deviations.values()), np.zeros(1))), self.value)
        for influence, c in self.sensitivities.items():
            out += c * deviations[influence.id]
        return out

    def __add__(self, other: Estimate | float) -> Estimate:
        b = _lifted(other, self.unit)
        unit = self.unit if self.unit == b.unit else ""
        return _combined(self.value + b.value, unit, ((1.0, self), (1.0, b)), lambda x, y: x + y)

    def __sub__(self, other: Estimate | float) -> Estimate:
        return self + -_lifted(other, self.unit)

    def __mul__(self, other: Estimate | float) -> Estimate:
        b = _lifted(other)
        unit = "" if self.unit and b.unit else self.unit or b.unit
        return _combined(self.value * b.value, unit, ((b.value, self), (self.value, b)), lambda x, y: x * y)

    def __truediv__(self, other: Estimate | float) -> Estimate:
        b = _lifted(other)
        terms = ((1 / b.value, self), (-self.value / b.value**2, b))
        return _combined(self.value / b.value, "" if b.unit else self.unit, terms, lambda x, y: x / y)

    def __pow__(self, other: Estimate | float) -> Estimate:
        b = _lifted(other)
        value = self.value**b.value
        if isinstance(value, complex):
            raise AnalysisError(f"{self.value} ** {b.value} is not a real number")
        slope = b.value * self.value ** (b.value - 1) if b.value != 0 else 0.0
        log = value * math.log(self.value) if b.sensitivities else 0.0
        return _combined(value, "", ((slope, self), (log, b)), lambda x, y: x**y)

    def __neg__(self) -> Estimate:
        return _combined(-self.value, self.unit, ((-1.0, self),), lambda x: -x)

    def __radd__(self, other: float) -> Estimate:
        return self + other

    def __rsub__(self, other: float) -> Estimate:
        return -self + other

    def __rmul__(self, other: float) -> Estimate:
        return self * other

    def __rtruediv__(self, other: float) -> Estimate:
        return _lifted(other) / self

    def __rpow__(self, other: float) -> Estimate:
        return _lifted(other) ** self


def _lifted(x: Estimate | float, unit: str = "") -> Estimate:
    return x if isinstance(x, Estimate) else Estimate.exact(x, unit)


def _combined(
    value: float, unit: str, terms: Sequence[tuple[float, Estimate]], operation: Callable[..., Array]
) -> Estimate:
    operands = [e for _, e in terms]
    sampler: Sampler | None = None
    if any(e.nonlinear for e in operands):

        def sampler(deviations: Deviations) -> Array:
            return operation(*(e.sampled(deviations) for e in operands))

    return Estimate(float(value), unit, merged(terms), sampler)


def merged(terms: Iterable[tuple[float, Estimate]]) -> dict[Influence, float]:
    """Sensitivities of sum(weight x estimate), one entry per influence id.

    Raises:
        AnalysisError: one id stands for two different influences.
    """
    firsts: dict[str, Influence] = {}
    sums: dict[str, float] = {}
    for weight, estimate in terms:
        for influence, c in estimate.sensitivities.items():
            key = influence.id
            first = firsts.get(key)
            if first is None:
                firsts[key], sums[key] = influence, 0.0 + weight * c
                continue
            if first is not influence:  # nearly always it is the very same
                _same(first, influence)
            sums[key] += weight * c
    return dict(zip(firsts.values(), sums.values(), strict=True))


def correlation(a: Estimate, b: Estimate) -> float:
    """Correlation coefficient from shared influences (GUM F.1.2.3); 0 where either has no uncertainty."""
    merged(((1.0, a), (1.0, b)))  # refuses an id that means two things
    other = b.contributions
    covariance = math.fsum(c * other.get(key, 0.0) for key, c in a.contributions.items())
    scale = a.u * b.u
    return max(-1.0, min(1.0, covariance / scale)) if scale > 0 else 0.0


def correlation_matrix(estimates: Sequence[Estimate]) -> list[list[float]]:
    """Symmetric matrix of correlation coefficients with a unit diagonal.

    Raises:
        AnalysisError: one id stands for two different influences.
    """
    column = {influence.id: k for k, influence in enumerate(merged((1.0, e) for e in estimates))}
    shares = np.zeros((len(estimates), len(column)))
    for row, estimate in zip(shares, estimates, strict=True):
        if estimate.u > 0:
            for key, c in estimate.contributions.items():
                row[column[key]] = c / estimate.u
    matrix = np.clip(np.einsum("ik,jk->ij", shares, shares), -1.0, 1.0)
    np.fill_diagonal(matrix, 1.0)
    rows: list[list[float]] = matrix.tolist()
    return rows
