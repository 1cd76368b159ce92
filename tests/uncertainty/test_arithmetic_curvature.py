"""Curvature in the arithmetic of estimates and between two influences, against algebra and Monte Carlo of our own."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from bench.procedure import Quantity
from bench.record.limits import Limit, Verdict
from bench.record.records import measurement
from bench.uncertainty import Estimate, Influence, interval, propagate


def estimate(identity: str, value: float, u: float) -> Estimate:
    return Estimate.of(value, Influence(identity, identity, u, "", "B", "normal"))


RNG = np.random.default_rng(2)
X, Y = RNG.standard_normal((2, 1_000_000))


@pytest.mark.parametrize(
    ("made", "drawn"),
    [
        (lambda x, y: x / y, lambda: (1 + 0.1 * X) / (1 + 0.2 * Y)),
        (lambda x, y: 1 / y, lambda: 1 / (1 + 0.2 * Y)),
        (lambda x, y: (y - 1) * (x - 1), lambda: 0.02 * X * Y),
        (lambda x, y: (y - 1) ** 2, lambda: (0.2 * Y) ** 2),
        (lambda x, y: y**-2, lambda: 1 / (1 + 0.2 * Y) ** 2),
        (lambda x, y: 2 * (x / y) + 3, lambda: 2 * (1 + 0.1 * X) / (1 + 0.2 * Y) + 3),
    ],
    ids=["ratio", "inverse", "product at zero", "square at zero", "inverse square", "carried on"],
)
def test_what_is_not_linear_goes_to_monte_carlo(
    made: Callable[[Estimate, Estimate], Estimate], drawn: Callable[[], np.ndarray]
) -> None:
    found = interval(made(estimate("x", 1.0, 0.1), estimate("y", 1.0, 0.2)))
    low, high = np.quantile(drawn(), [0.025, 0.975])
    assert found.method == "monte-carlo"
    assert (found.low, found.high) == pytest.approx((low, high), abs=0.02 * (high - low))


def test_a_ratio_with_a_30_percent_denominator_is_not_linear() -> None:
    ratio = estimate("a", 3.0, 0.01) / estimate("b", 1.0, 0.3)
    assert ratio.nonlinear
    assert propagate(lambda p: p["a"] / p["b"], {"a": estimate("a", 3.0, 0.01), "b": estimate("b", 1.0, 0.3)}).nonlinear
    found = interval(ratio)
    assert found.high - ratio.value > 1.5 * (ratio.value - found.low)  # the linear one was value -+ 1.76


def test_what_is_linear_stays_so() -> None:
    a, b = estimate("a", 3.0, 0.03), estimate("b", 7.0, 0.1)
    for e in (a * b, a / b, a**2, 2**a, a * 1e3, 1e3 / b, (a - 3) * 0.5, a / a, 5 * a / (2 * a), a - a):
        assert not e.nonlinear
    wide = estimate("wide", 1.0, 0.5)
    assert not (wide / wide).nonlinear  # is one, whatever it is
    assert not (wide * 3 - 1).nonlinear


def test_the_product_of_two_values_at_zero_is_looked_at_between_its_influences() -> None:
    x, y = estimate("x", 0.0, 0.1), estimate("y", 0.0, 0.2)
    by_function = propagate(lambda p: p["x"] * p["y"], {"x": x, "y": y})
    low, high = np.quantile(0.02 * X * Y, [0.025, 0.975])
    for product in (x * y, by_function):
        found = interval(product)
        assert product.u == 0
        assert (found.low, found.high) == pytest.approx((low, high), rel=0.02)
        assert found.u == pytest.approx(0.02, rel=0.02)


def test_curvature_between_many_influences_is_found() -> None:
    """A sum of products of neighbours: no influence bends anything by itself."""
    inputs = {str(k): estimate(str(k), 0.02, 0.1) for k in range(12)}
    found = propagate(lambda p: sum(p[str(k)] * p[str(k + 1)] for k in range(11)), inputs)
    assert found.nonlinear
    far = {str(k): estimate(str(k), 20.0, 0.1) for k in range(12)}
    assert not propagate(lambda p: sum(p[str(k)] * p[str(k + 1)] for k in range(11)), far).nonlinear


def test_nothing_passes_on_an_uncertainty_of_nought() -> None:
    """Where influences are there and none moves the value, a limit cannot be judged."""
    q, limit = Quantity("q", "1", "a number"), Limit(-1.0, 1.0, "1", "test", True)
    x = estimate("x", 0.0, 0.1)
    flat = Estimate(0.5, "1", {next(iter(x.sensitivities)): 0.0})
    assert measurement(q.measured(flat), limit).verdict is Verdict.INDETERMINATE
    assert measurement(q.measured(flat), None).verdict is Verdict.NONE
    assert measurement(q.measured(Estimate.exact(0.5, "1")), limit).verdict is Verdict.PASS  # a count
    assert math.isclose(measurement(q.measured(x), limit).expanded_uncertainty or 0, 0.196, rel_tol=1e-3)
