"""Weighted least squares of map, cells and readings over all loads, with what certificates say as observations of their own.

The value of a certificate is an observation with its u, so that the covariance has everything, and the row of a term in
(J'J)^-1 J' is what each certificate does to it. Where data know better than a certificate, its term says so: `pulls`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.errors import AnalysisError
from bench.rigfile.toleranced import Distribution
from procedures.shared.leastsquares import nonlinear
from procedures.static_characteristics.model import PHASES, Array, Rows, Terms, shown

SHARE = 5e-4  # of a load, beside noise: what rounding of currents and friction leave of it
TIED = 1e-6  # of the mean of the gains
KNOWING = 0.98  # of a certificate's u: where data leave more of it, they say nothing


@dataclass(frozen=True)
class Known:
    """Of a term (its number): what a certificate says of it, and what a budget calls that. A term that is a share of what the
    certificate states counts `per`, in `unit`: a budget has the certificate's own u, `stated`, where that is not 0."""

    term: int
    value: float
    u: float
    identity: str
    distribution: Distribution = "rectangular"
    unit: str = "1"
    per: float = 1.0
    stated: float = 0.0


@dataclass(frozen=True)
class Found:
    """Terms and covariance; `gains` (terms, known), what each certificate does to each term; `scatter` (terms, terms), the part
    of the covariance that residuals make; `residuals` (n,) N and (n,) N m, and their size in units of what was expected.
    `expected`: terms and variances as they are by what was expected, whatever was found: what the formula lacks would make
    every term uncertain, and say nothing against any."""

    terms: Array
    covariance: Array
    gains: Array
    scatter: Array
    residuals: tuple[Array, Array]
    size: float
    expected: tuple[Array, Array]


def fitted(rows: Rows, first: Array, known: Sequence[Known]) -> Found:
    """The terms that fit.

    Raises:
        AnalysisError: the loads do not determine the map.
    """
    terms, size = first, 1.0
    numbers = np.array([k.term for k in known])
    said, u = np.array([k.value for k in known]), np.array([k.u for k in known])
    at, n = Terms(len(rows.x)), len(rows.force)
    observed = np.concatenate([rows.force, rows.torque, said, [1.0]])
    base = np.concatenate(
        [np.hypot(noise, SHARE * load) for noise, load in zip(rows.noise, (rows.force, rows.torque), strict=True)]
    )

    def model(t: Array) -> Array:
        return np.concatenate([*shown(t, rows), t[numbers], [t[at.each("gain")].mean()]])

    expected = (terms, np.ones(at.count))
    for again in range(2):  # the second by what the residuals of the first are
        weight = np.concatenate([size * base, u, [TIED]])
        found = nonlinear(model, observed, terms, weight)
        expected = expected if again else (found.terms, np.diag(found.covariance))
        terms = found.terms
        left = found.residuals[: 2 * n]
        size = math.sqrt(float(((left / base) ** 2).sum()) / max(2 * n - (at.count - len(known)), 1))
        if not np.isfinite(size) or size <= 0:
            raise AnalysisError("residuals are not finite")
    by = found.covariance @ (found.jacobian / weight[:, None]).T / weight  # what each observation does to each term
    scatter = _by_phases(by[:, : 2 * n], found.jacobian[: 2 * n], rows, left)
    return Found(
        terms, found.covariance, by[:, 2 * n : 2 * n + len(known)], scatter, (left[:n], left[n:]), size, expected
    )


def _by_phases(by: Array, jacobian: Array, rows: Rows, left: Array) -> Array:
    """Covariance (terms, terms) that residuals make: those of one phase at one place are one observation, as in
    `inductance_map.fit`: the jackknife over them (Bell and McCaffrey, Survey Methodology 28, 169 (2002), CR3)."""
    group = np.tile(rows.place * PHASES + rows.phase, 2)
    out = np.zeros((len(by), len(by)))
    for one in np.unique(group):
        some = np.flatnonzero(group == one)
        own = np.eye(len(some)) - jacobian[some] @ by[:, some]
        moved = by[:, some] @ np.linalg.solve(own, left[some])
        out += np.outer(moved, moved)
    return out


def pulls(found: Found, known: Sequence[Known]) -> dict[str, float]:
    """By identity of the certificates that data know better: how far off they are, in standard uncertainties of the
    difference."""
    out, (terms, variances) = {}, found.expected
    for one in known:
        left = float(variances[one.term])
        if left < (KNOWING * one.u) ** 2:
            out[one.identity] = float(terms[one.term] - one.value) / math.sqrt(one.u**2 - left)
    return out
