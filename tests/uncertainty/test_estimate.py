"""Arithmetic by identity, against GTC and against algebra."""

from __future__ import annotations

import math

import GTC
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.errors import AnalysisError
from bench.uncertainty import Estimate, Influence, correlation, correlation_matrix, propagate, welch_satterthwaite


def influence(identity: str, u: float, dof: float = math.inf, distribution: str = "normal") -> Influence:
    return Influence(identity, identity, u, "", "B", distribution, dof)  # type: ignore[arg-type]


def estimate(identity: str, value: float, u: float, dof: float = math.inf) -> Estimate:
    return Estimate.of(value, influence(identity, u, dof))


def test_correlated_sum_ratio_and_product_agree_with_gtc() -> None:
    a, b, c = estimate("a", 3.0, 0.1, 5), estimate("b", 7.0, 0.2, 9), estimate("c", -2.0, 0.05)
    ga, gb, gc = GTC.ureal(3.0, 0.1, 5), GTC.ureal(7.0, 0.2, 9), GTC.ureal(-2.0, 0.05)
    x, y = a + 2 * b, a / b * c - 1
    gx, gy = ga + 2 * gb, ga / gb * gc - 1
    for ours, oracle in ((x, gx), (y, gy), (x * y, gx * gy), (x / y, gx / gy), (a**b, ga**gb), (2**a, 2**ga)):
        assert ours.value == pytest.approx(GTC.value(oracle), rel=1e-12)
        assert ours.u == pytest.approx(GTC.uncertainty(oracle), rel=1e-12)
        assert welch_satterthwaite(ours) == math.floor(GTC.dof(oracle))
    assert correlation(x, y) == pytest.approx(GTC.get_correlation(gx, gy), rel=1e-12)


def test_propagate_agrees_with_gtc_through_shared_inputs() -> None:
    lever, load = estimate("lever", 0.15, 5e-5), estimate("load", 3.0, 1e-4, 12)
    inputs = {"span": 0.125 + 0 * lever, "arm": lever, "both": lever + load}
    found = propagate(lambda p: {"r": math.sin(p["arm"]) * p["both"] / p["span"], "s": p["both"] - p["arm"]}, inputs)
    glever, gload = GTC.ureal(0.15, 5e-5), GTC.ureal(3.0, 1e-4, 12)
    oracle = GTC.sin(glever) * (glever + gload) / 0.125
    assert found["r"].u == pytest.approx(GTC.uncertainty(oracle), rel=1e-6)
    assert found["s"].u == pytest.approx(1e-4, rel=1e-6)  # the lever cancels
    assert correlation(found["r"], load) == pytest.approx(GTC.get_correlation(oracle, gload), rel=1e-5)
    assert not found["r"].nonlinear


def test_a_square_at_its_turning_point_is_nonlinear_and_stays_so() -> None:
    bent = propagate(lambda p: p["x"] ** 2, {"x": estimate("x", 0.0, 1.0)})
    straight = propagate(lambda p: p["x"] ** 2, {"x": estimate("x", 100.0, 1.0)})
    assert bent.nonlinear
    assert (bent + 1).nonlinear
    assert propagate(lambda p: 2 * p["y"], {"y": bent}).nonlinear
    assert not straight.nonlinear


def test_one_identity_cannot_mean_two_influences() -> None:
    for other in (estimate("a", 1.0, 0.2), estimate("a", 1.0, 0.1, 4), Estimate.of(1.0, influence("a", 0.1, math.inf,
                                                                                    "rectangular"))):  # fmt: skip
        with pytest.raises(AnalysisError, match="found twice"):
            estimate("a", 1.0, 0.1) + other
        with pytest.raises(AnalysisError, match="found twice"):
            correlation(estimate("a", 1.0, 0.1), other)


@pytest.mark.parametrize(("u", "dof"), [(-1.0, 3.0), (math.nan, 3.0), (math.inf, 3.0), (1.0, 0.0), (1.0, math.nan)])
def test_an_influence_must_make_sense(u: float, dof: float) -> None:
    with pytest.raises(AnalysisError):
        influence("a", u, dof)


def test_a_model_that_gives_no_number_is_refused() -> None:
    with pytest.raises(AnalysisError, match="finite"):
        propagate(lambda p: math.nan, {"x": estimate("x", 0.0, 1.0)})


def test_numpy_numbers_on_the_left_and_units() -> None:
    force = Estimate.of(2.0, Influence("f", "f", 0.1, "N", "B", "normal"))
    doubled = np.float64(2) * force
    assert isinstance(doubled, Estimate)
    assert (doubled.unit, (force + 1.0).unit, (force / force).unit) == ("N", "N", "")


numbers = st.floats(-1e3, 1e3).filter(lambda x: abs(x) > 1e-2)
spreads = st.floats(1e-6, 10)


@given(numbers, numbers, spreads, spreads)
def test_algebra(x: float, y: float, u: float, v: float) -> None:
    a, b = estimate("a", x, u), estimate("b", y, v)
    assert (a - a).u == 0
    assert (a / a).u == pytest.approx(0, abs=1e-9 * u / abs(x))
    assert (a + b).u == pytest.approx(math.hypot(u, v))
    assert (a * b / b).u == pytest.approx(u, rel=1e-6)
    assert (a**2).contributions["a"] == pytest.approx((a * a).contributions["a"])
    assert ((a + b) - b).contributions["b"] == 0
    assert (1 / (1 / a)).value == pytest.approx(x)
    assert (-a).contributions["a"] == -u
    assert (3 - a).contributions == (-a + 3).contributions
    (one, r), (s, two) = correlation_matrix([a + b, a - b])
    assert one == two == 1
    assert r == s == pytest.approx((u * u - v * v) / (u * u + v * v), abs=1e-9)
