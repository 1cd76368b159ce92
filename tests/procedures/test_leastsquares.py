"""Least squares: exact on exact data, against numpy, scipy's odr and curve_fit, and honest covariances on noise."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize

from bench.errors import AnalysisError
from procedures.shared.leastsquares import correlated, lack_of_fit, line, linear, nonlinear

numbers = st.floats(-100, 100, allow_nan=False)


@settings(deadline=None)
@given(st.lists(numbers, min_size=3, max_size=3), st.integers(0, 10_000))
def test_exact_data_give_the_terms_back(terms: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(12, 3))
    fit = linear(x, x @ terms)
    np.testing.assert_allclose(fit.terms, terms, atol=1e-9)
    np.testing.assert_allclose(linear(x, x @ terms, rng.uniform(0.1, 10, 12)).terms, terms, atol=1e-9)


@settings(deadline=None)
@given(st.integers(0, 10_000))
def test_covariance_is_polyfit_s(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y, u = rng.normal(size=20), rng.normal(size=20), rng.uniform(0.5, 2, 20)
    design = np.vander(x, 3)
    for ours, (terms, covariance) in (
        (linear(design, y), np.polyfit(x, y, 2, cov=True)),
        (linear(design, y, u**2), np.polyfit(x, y, 2, w=1 / u, cov="unscaled")),
        (linear(design, y, np.diag(u**2)), np.polyfit(x, y, 2, w=1 / u, cov="unscaled")),
    ):
        np.testing.assert_allclose(ours.terms, terms, rtol=1e-7, atol=1e-10)
        np.testing.assert_allclose(ours.covariance, covariance, rtol=1e-7, atol=1e-10)


@settings(deadline=None)
@given(st.integers(0, 10_000), st.floats(1e-6, 1e6))
def test_units_do_not_matter(seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(15, 3)), rng.normal(size=15)
    plain, scaled = linear(x, y), linear(x * [factor, 1, 1], y)
    assert scaled.terms[0] * factor == pytest.approx(plain.terms[0], rel=1e-7, abs=1e-9)
    assert scaled.u[0] * factor == pytest.approx(plain.u[0], rel=1e-7)


def test_shared_errors_are_no_scatter() -> None:
    """An error common to all observations goes into the constant, not into the slope, when the covariance says so."""
    x = np.arange(6.0)
    design = np.column_stack([np.ones(6), x])
    alone = linear(design, 2 + 3 * x, np.full(6, 0.01))
    shared = linear(design, 2 + 3 * x, 0.01 * np.eye(6) + 25.0)
    assert shared.u[1] == pytest.approx(alone.u[1], rel=1e-9)
    assert shared.u[0] == pytest.approx(np.hypot(alone.u[0], 5.0), rel=1e-9)


@pytest.mark.parametrize("design", [np.ones((4, 2)), np.zeros((4, 1)), np.eye(2), np.full((4, 1), np.nan)])
def test_what_cannot_be_fitted_is_told(design: np.ndarray) -> None:
    with pytest.raises(AnalysisError):
        linear(design, np.ones(len(design)))


def test_lack_of_fit_sees_a_bend_and_nothing_else() -> None:
    """Probabilities are uniform on sound data; a bend of three standard deviations is seen."""
    rng = np.random.default_rng(5)
    x = np.repeat(np.arange(5.0), 4)
    design = np.column_stack([np.ones_like(x), x])
    p = [lack_of_fit(linear(design, 1 + x + rng.normal(size=20)), x).p_value for _ in range(400)]
    assert 0.4 < np.mean(p) < 0.6
    assert 0.02 < np.mean(np.array(p) < 0.05) < 0.09
    bent = linear(design, 1 + x + 3 * (x - 2) ** 2 / 4 + rng.normal(size=20))
    assert lack_of_fit(bent, x).p_value < 1e-3
    with pytest.raises(AnalysisError):
        lack_of_fit(linear(design[::4], x[::4] ** 2), x[::4])


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.floats(-5, 5))
def test_the_line_is_odr_s(seed: int, slope: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the oracle is on its way out of scipy
        from scipy import odr
    rng = np.random.default_rng(seed)
    true, n = np.linspace(0, 10, 12), 12
    ux, uy = rng.uniform(0.05, 0.2, n), rng.uniform(0.05, 0.2, n)
    x, y = true + ux * rng.normal(size=n), 1 + slope * true + uy * rng.normal(size=n)
    ours = line(x, y, ux, uy)
    data = odr.RealData(x, y, sx=ux, sy=uy)
    theirs = odr.ODR(data, odr.unilinear, beta0=[slope + 0.1, 0.9], sstol=1e-14, partol=1e-14).run()
    assert ours.slope == pytest.approx(theirs.beta[0], rel=1e-5, abs=1e-5)
    assert ours.intercept == pytest.approx(theirs.beta[1], rel=1e-5, abs=1e-5)
    assert ours.chi2 == pytest.approx(theirs.sum_square, rel=1e-6)
    root = np.sqrt(np.diag(ours.covariance))
    np.testing.assert_allclose(root, np.sqrt(np.diag(theirs.cov_beta))[::-1], rtol=0.03)


@settings(deadline=None)
@given(st.integers(0, 10_000))
def test_a_line_without_errors_in_x_is_the_linear_fit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, uy = np.linspace(0, 5, 9), rng.uniform(0.1, 1, 9)
    y = 2 - 3 * x + uy * rng.normal(size=9)
    ours, plain = line(x, y, 0.0, uy), linear(np.column_stack([np.ones(9), x]), y, uy**2)
    np.testing.assert_allclose([ours.intercept, ours.slope], plain.terms, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(ours.covariance, plain.covariance, rtol=1e-8)


def test_errors_in_x_bias_a_plain_fit_and_not_the_line() -> None:
    rng = np.random.default_rng(1)
    true = np.linspace(0, 10, 11)
    plain, both = [], []
    for _ in range(300):
        x, y = true + 2 * rng.normal(size=11), 2 * true + 0.5 * rng.normal(size=11)
        plain.append(np.polyfit(x, y, 1)[0])
        both.append(line(x, y, 2.0, 0.5).slope)
    assert np.mean(plain) < 1.6
    assert np.median(both) == pytest.approx(2.0, abs=0.05)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.booleans())
def test_nonlinear_is_curve_fit_s(seed: int, stated: bool) -> None:
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 3, 60)
    u = rng.uniform(0.01, 0.03, 60)
    y = 5 * np.exp(-1.3 * t) + 0.4 + u * rng.normal(size=60)

    def model(x: np.ndarray, a: float, b: float, c: float) -> np.ndarray:
        return a * np.exp(-b * x) + c

    ours = nonlinear(lambda p: model(t, *p), y, [4.0, 1.0, 0.0], u if stated else None)
    terms, covariance = optimize.curve_fit(model, t, y, [4.0, 1.0, 0.0], u if stated else None, absolute_sigma=stated)
    np.testing.assert_allclose(ours.terms, terms, rtol=1e-6)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))  # terms that hardly correlate have a small one
    np.testing.assert_allclose(ours.covariance / scale, covariance / scale, rtol=0, atol=1e-3)


def test_terms_that_do_nothing_are_told() -> None:
    with pytest.raises(AnalysisError):
        nonlinear(lambda p: np.full(9, p[0]) + 0 * p[1], np.arange(9.0), [1.0, 1.0])


def test_residuals_that_repeat_themselves_count_less() -> None:
    """A first-order process with a memory of 20 samples: the true scatter of the slope is some six times the white one."""
    rng = np.random.default_rng(3)
    n, keep = 2000, np.exp(-1 / 20)
    x = np.linspace(-1, 1, n)
    design = np.column_stack([np.ones(n), x])
    slopes, white, honest = [], [], []
    for _ in range(120):
        noise = np.zeros(n)
        steps = rng.normal(size=n)
        for k in range(1, n):
            noise[k] = keep * noise[k - 1] + steps[k]
        fit = linear(design, noise)
        slopes.append(fit.terms[1])
        white.append(fit.u[1])
        honest.append(np.sqrt(correlated(fit, 120)[1, 1]))
    assert np.std(slopes) > 4 * np.mean(white)
    assert np.mean(honest) == pytest.approx(np.std(slopes), rel=0.25)
