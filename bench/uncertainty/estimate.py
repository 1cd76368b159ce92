"""A value and its elementary influences, with arithmetic that keeps them apart by identity.

Two estimates that share an influence are correlated because they share it; no correlation is ever typed in
(GUM 5.2.4, F.1.2.3: correlations removed by making the common influences inputs of their own).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
Distribution = Literal["normal", "rectangular", "triangular", "arcsine"]
Deviations = Mapping[str, Array]  # influence id -> drawn deviations from its expectation
Sampler = Callable[[Deviations], Array]
NONLINEAR = 0.1  # share of the combined u that second differences may reach
ROUNDING = 1e-10  # of squares that cancel, as in x/x


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
    `sampler` is set where that is not enough: it evaluates the model for drawn influences. Products, ratios and powers set it
    where their second order is more than NONLINEAR of the combined u, as `propagate` does.
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
        terms = ((b.value, self), (self.value, b))
        return _combined(self.value * b.value, unit, terms, lambda x, y: x * y, (0.0, 1.0, 0.0))

    def __truediv__(self, other: Estimate | float) -> Estimate:
        b = _lifted(other)
        terms = ((1 / b.value, self), (-self.value / b.value**2, b))
        bends = (0.0, -1 / b.value**2, 2 * self.value / b.value**3)
        return _combined(self.value / b.value, "" if b.unit else self.unit, terms, lambda x, y: x / y, bends)

    def __pow__(self, other: Estimate | float) -> Estimate:
        b = _lifted(other)
        value = self.value**b.value
        if isinstance(value, complex):
            raise AnalysisError(f"{self.value} ** {b.value} is not a real number")
        x, y = self.value, b.value
        slope = y * x ** (y - 1) if y != 0 else 0.0
        bend = y * (y - 1) * x ** (y - 2) if y not in (0, 1) and self.sensitivities else 0.0
        log = math.log(x) if b.sensitivities else 0.0
        bends = (bend, (value / x) * (1 + y * log) if b.sensitivities else 0.0, value * log**2)
        return _combined(value, "", ((slope, self), (value * log, b)), lambda x, y: x**y, bends)

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
    value: float,
    unit: str,
    terms: Sequence[tuple[float, Estimate]],
    operation: Callable[..., Array],
    bends: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Estimate:
    """`bends` are the second derivatives of the operation, xx, xy, yy."""
    operands = [e for _, e in terms]
    made = Estimate(float(value), unit, merged(terms))
    sampler: Sampler | None = None
    second = _second_order(operands[0], operands[-1], bends)
    if any(e.nonlinear for e in operands) or (second > 0 and second > NONLINEAR * made.u):

        def sampler(deviations: Deviations) -> Array:
            return operation(*(e.sampled(deviations) for e in operands))

    return made if sampler is None else replace(made, sampler=sampler)


def _second_order(x: Estimate, y: Estimate, bends: tuple[float, float, float]) -> float:
    """Size of the matrix of second differences that an operation has for the influences of its operands, each moved by its u:
    root of the sum of squares of all its elements, so that what bends between two influences counts too (GUM 5.1.2, note).

    With the vectors X and Y of their contributions it is f_xx XX' + f_xy (XY' + YX') + f_yy YY'.
    """
    f_xx, f_xy, f_yy = bends
    both = bool(f_xy and x.sensitivities and y.sensitivities)
    u = x.u if both or (f_xx and x.sensitivities) else 0.0
    v = y.u if both or (f_yy and y.sensitivities) else 0.0
    if u == v == 0:
        return 0.0
    other = y.contributions if both and u and v else {}
    r = math.fsum(c / u * (other[i] / v) for i, c in x.contributions.items() if i in other) if other else 0.0
    a, b, d = f_xx * u * u, f_xy * u * v, f_yy * v * v
    largest = max(abs(a), abs(b), abs(d))
    if largest == 0:
        return 0.0
    a, b, d = a / largest, b / largest, d / largest  # squares of small numbers would underflow
    total = a * a + d * d + 2 * b * b * (1 + r * r) + 2 * a * d * r * r + 4 * (a + d) * b * r
    return largest * math.sqrt(total) if total > ROUNDING else 0.0


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
