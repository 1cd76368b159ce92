"""Least squares with honest covariances: weighted linear, a line with errors in both variables, and nonlinear.

Where the scatter of the observations is stated, it makes the covariance; where it is not, the residuals make it. Residuals
that repeat their neighbours (a time series) need `correlated`: s/sqrt(n) would be far too small.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Fit:
    """`terms` (p,) and their `covariance` (p, p); `residuals` (n,), observed less fitted; `chi2` of the weighted residuals;
    `dof` = n - p; `jacobian` (n, p), d fitted / d terms."""

    terms: Array
    covariance: Array
    residuals: Array
    chi2: float
    dof: int
    jacobian: Array

    @property
    def u(self) -> Array:
        """Standard uncertainties of the terms (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def p_value(self) -> float:
        """Probability of a chi-squared this large by chance; means something where the scatter was stated."""
        from scipy import special

        return float(special.chdtrc(self.dof, self.chi2)) if self.dof > 0 else 1.0


def linear(design: npt.ArrayLike, observed: npt.ArrayLike, covariance: npt.ArrayLike | None = None) -> Fit:
    """Best linear unbiased fit of `observed` (n,) = `design` (n, p) @ terms.

    `covariance` of the observations is (n,) variances or (n, n); without it they scatter alike and independently, by as
    much as the residuals say: terms' covariance = s^2 (X' X)^-1, s^2 = r' r / (n - p).

    Raises:
        AnalysisError: shapes do not match, numbers are not finite, the columns of the design depend on each other, a
            covariance is not positive definite, or no residual is left to tell the scatter.
    """
    x, y = np.asarray(design, np.float64), np.asarray(observed, np.float64)
    if x.ndim != 2 or y.shape != x.shape[:1]:
        raise AnalysisError(
            f"least squares: found design {x.shape} and {y.shape} observations; expected (n, p) and (n,)"
        )
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise AnalysisError("least squares: found numbers that are not finite")
    n, p = x.shape
    xw, yw = _whitened(x, y, covariance)
    scale = np.sqrt((xw**2).sum(axis=0))
    if n < p or (scale == 0).any() or np.linalg.matrix_rank(xw / scale) < p:
        raise AnalysisError(f"least squares: {n} observations do not determine {p} terms")
    q, r = np.linalg.qr(xw / scale)
    solved = np.linalg.solve(r, np.column_stack([q.T @ yw, np.eye(p)])) / scale[:, None]  # scipy's would start threads
    terms, inverse = solved[:, 0], solved[:, 1:]
    chi2 = float(((yw - xw @ terms) ** 2).sum())
    out = inverse @ inverse.T
    if covariance is None:
        if n == p:
            raise AnalysisError(f"least squares: {n} observations and {p} terms leave no residual to tell the scatter")
        out = out * chi2 / (n - p)
    return Fit(terms, out, y - x @ terms, chi2, n - p, x)


def _whitened(x: Array, y: Array, covariance: npt.ArrayLike | None) -> tuple[Array, Array]:
    from scipy import linalg

    if covariance is None:
        return x, y
    v = np.asarray(covariance, np.float64)
    if v.shape == y.shape:
        if not (np.isfinite(v).all() and (v > 0).all()):
            raise AnalysisError("least squares: found a variance that is not positive")
        root = np.sqrt(v)
        return x / root[:, None], y / root
    if v.shape != (*y.shape, *y.shape):
        raise AnalysisError(
            f"least squares: found covariance {v.shape}; expected (n,) or (n, n) for {len(y)} observations"
        )
    try:
        lower = np.linalg.cholesky(v)
    except np.linalg.LinAlgError as error:
        raise AnalysisError("least squares: the covariance of the observations is not positive definite") from error
    both = linalg.solve_triangular(lower, np.column_stack([x, y]), lower=True)
    return both[:, :-1], both[:, -1]


@dataclass(frozen=True)
class LackOfFit:
    """F of the scatter about the model against that of repeats, its degrees of freedom, and the probability of as much."""

    F: float
    dof_model: int
    dof_repeats: int
    p_value: float


def lack_of_fit(fit: Fit, groups: npt.ArrayLike) -> LackOfFit:
    """F test of a linear fit of equal weights: do the means of the repeats lie on the model as their scatter allows?

    `groups` (n,) says which observations repeat each other (equal rows of the design). Sum of squares of the residuals =
    that within groups (pure error) + that of the groups' means (lack of fit) (Draper and Smith, Applied Regression, 2.1).

    Raises:
        AnalysisError: no repeats, or no more groups than terms.
    """
    from scipy import special

    labels, member = np.unique(np.asarray(groups), return_inverse=True)
    r, levels, p = fit.residuals, len(labels), len(fit.terms)
    repeats, model = len(r) - levels, levels - p
    if repeats < 1 or model < 1:
        raise AnalysisError(
            f"lack of fit: found {len(r)} observations in {levels} groups; expected repeats, and over {p} groups"
        )
    means = np.bincount(member, r) / np.bincount(member)
    pure = float(((r - means[member]) ** 2).sum())
    lack = max(float((r**2).sum()) - pure, 0.0)
    f = (lack / model) / (pure / repeats) if pure > 0 else (np.inf if lack > 0 else 0.0)
    return LackOfFit(float(f), model, repeats, float(special.fdtrc(model, repeats, f)))


@dataclass(frozen=True)
class Line:
    """y = intercept + slope x; covariance (2, 2) in that order; chi-squared, `dof` = n - 2; `x` (n,) the fitted abscissas."""

    intercept: float
    slope: float
    covariance: Array
    chi2: float
    dof: int
    x: Array


def line(x: npt.ArrayLike, y: npt.ArrayLike, ux: npt.ArrayLike, uy: npt.ArrayLike, r: npt.ArrayLike = 0.0) -> Line:
    """A line with errors in both variables, each point with its own u and correlation r between x and y.

    The effective variance uy^2 + b^2 ux^2 - 2 b r ux uy weighs each point; the slope is found by York's iteration (York et
    al., Am. J. Phys. 72, 367 (2004)), which is the maximum likelihood and, for one ratio ux/uy, total least squares.

    Raises:
        AnalysisError: fewer than three points, shapes that do not match, a point without uncertainty, or no convergence.
    """
    X, Y, ux, uy, r = (np.array(a, np.float64) for a in np.broadcast_arrays(x, y, ux, uy, r))
    if X.ndim != 1 or len(X) < 3 or not (np.isfinite(X).all() and np.isfinite(Y).all()):
        raise AnalysisError(f"line: found {X.shape} points; expected three or more finite ones")
    if not ((ux >= 0) & (uy >= 0) & (ux + uy > 0) & (np.abs(r) < 1)).all():
        raise AnalysisError("line: found a point without uncertainty; expected u of x or of y above 0")
    b = float(np.polyfit(X, Y, 1)[0])
    for _ in range(200):
        w = 1 / (uy**2 + b**2 * ux**2 - 2 * b * r * ux * uy)
        xm, ym = (w * X).sum() / w.sum(), (w * Y).sum() / w.sum()
        u, v = X - xm, Y - ym
        beta = w * (u * uy**2 + b * v * ux**2 - (b * u + v) * r * ux * uy)
        before, b = b, float((w * beta * v).sum() / (w * beta * u).sum())
        if abs(b - before) <= 1e-14 * max(abs(b), np.ptp(Y) / max(np.ptp(X), 1e-300)):
            break
    else:
        raise AnalysisError("line: the slope does not converge")
    a = ym - b * xm
    fitted = xm + beta
    fm = (w * fitted).sum() / w.sum()
    vb = 1 / (w * (fitted - fm) ** 2).sum()
    covariance = np.array([[1 / w.sum() + fm**2 * vb, -fm * vb], [-fm * vb, vb]])
    return Line(float(a), b, covariance, float((w * (Y - a - b * X) ** 2).sum()), len(X) - 2, fitted)


def nonlinear(
    model: Callable[[Array], Array],
    observed: npt.ArrayLike,
    start: npt.ArrayLike,
    u: npt.ArrayLike | None = None,
    jacobian: Callable[[Array], Array] | None = None,
) -> Fit:
    """Fit `model`(terms) (n,) to `observed` (n,) by Levenberg and Marquardt's method.

    With `u` (n,), standard uncertainties of independent observations, the covariance is (J' J)^-1 of the weighted problem;
    without, it is scaled by the residuals. Linearised about the solution (GUM 5.1); see `correlated` for time series.

    Raises:
        AnalysisError: no convergence, fewer observations than terms, or terms that the observations do not determine.
    """
    from scipy import optimize

    y = np.asarray(observed, np.float64)
    p0 = np.asarray(start, np.float64)
    weight = np.ones_like(y) if u is None else 1 / np.asarray(u, np.float64)
    if len(y) <= len(p0) or not (np.isfinite(y).all() and np.isfinite(weight).all()):
        raise AnalysisError(f"fit: found {len(y)} finite observations; expected more than the {len(p0)} terms")
    slopes = "2-point" if jacobian is None else lambda p: weight[:, None] * jacobian(p)
    found = optimize.least_squares(
        lambda p: weight * (model(p) - y),
        p0,
        jac=slopes,
        method="lm",
        x_scale="jac",
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
    )
    if not found.success or not np.isfinite(found.x).all():
        raise AnalysisError(f"fit: no convergence: {found.message}")
    jac = found.jac / weight[:, None]
    dof, chi2 = len(y) - len(p0), float((found.fun**2).sum())
    scale = np.sqrt((found.jac**2).sum(axis=0))
    if (scale == 0).any() or np.linalg.matrix_rank(found.jac / scale) < len(p0):
        raise AnalysisError("fit: the observations do not determine the terms")
    inverse = np.linalg.inv((found.jac / scale).T @ (found.jac / scale)) / np.outer(scale, scale)
    return Fit(found.x, inverse if u is not None else inverse * chi2 / dof, y - model(found.x), chi2, dof, jac)


def correlated(fit: Fit, lags: int) -> Array:
    """Covariance (p, p) of the terms of an unweighted fit of a time series whose residuals repeat their neighbours.

    (J'J)^-1 J' V J (J'J)^-1 with V from the residuals' own autocovariance up to `lags`, Bartlett's weights keep it positive
    (Newey and West, Econometrica 55, 703 (1987)). `lags` should be several correlation times.

    Raises:
        AnalysisError: `lags` is not shorter than the series.
    """
    n, p = fit.jacobian.shape
    if not 0 <= lags < n:
        raise AnalysisError(f"correlated: found {lags} lags; expected fewer than the {n} residuals")
    moved = fit.jacobian * fit.residuals[:, None]
    middle = moved.T @ moved
    for lag in range(1, lags + 1):
        cross = moved[lag:].T @ moved[:-lag]
        middle += (1 - lag / (lags + 1)) * (cross + cross.T)
    scale = np.sqrt((fit.jacobian**2).sum(axis=0))
    j = fit.jacobian / scale
    inverse = np.linalg.inv(j.T @ j) / np.outer(scale, scale)
    out: Array = inverse @ middle @ inverse * n / (n - p)
    return out
