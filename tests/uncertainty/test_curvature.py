"""Draws of a model by its expansion: the same where it is of second order, and refused where it is not."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest

from bench.uncertainty import interval
from bench.uncertainty.curvature import expanded
from bench.uncertainty.estimate import Estimate, Influence
from bench.uncertainty.propagation import propagate

N = 4000


def deviations(names: str, u: float = 0.1) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    return {name: u * rng.standard_normal(N) for name in names}


def test_a_model_of_second_order_is_drawn_as_it_is() -> None:
    """Squares and products, one of them of two influences without a slope of their own."""

    def model(z: Mapping[str, float]) -> float:
        a, b, c = (z.get(k, 0.0) for k in "abc")
        return 3 + 2 * a - 0.3 * a**2 + 0.5 * a * b + 0.4 * b * c

    drawn = deviations("abc")
    z = {k: v / 0.1 for k, v in drawn.items()}
    exact = 3 + 2 * z["a"] - 0.3 * z["a"] ** 2 + 0.5 * z["a"] * z["b"] + 0.4 * z["b"] * z["c"]
    found = expanded(model, dict.fromkeys("abc", 0.1), drawn)
    assert found is not None
    assert found == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("power", [0.5, 3.0], ids=["mild", "strong"])
def test_where_the_model_is_not_of_second_order_it_is_not_believed(power: float) -> None:
    found = expanded(lambda z: math.exp(power * z.get("a", 0.0)), {"a": 0.1}, deviations("a"))
    assert found is None


def test_a_slow_model_is_asked_some_hundred_times_not_for_every_draw() -> None:
    asked = 0

    def slow(p: Mapping[str, float]) -> float:
        nonlocal asked
        asked += 1
        return p["x"] + 0.3 * p["x"] ** 2

    x = Estimate.of(0.0, Influence("x", "x", 1.0, "", "B", "normal"))
    estimate = propagate(slow, {"x": x})
    assert estimate.nonlinear
    found = interval(estimate, seed=5)
    assert asked < 1000
    edge = np.quantile((lambda z: z + 0.3 * z**2)(np.random.default_rng(1).standard_normal(2_000_000)), [0.025, 0.975])
    assert [found.low, found.high] == pytest.approx(edge.tolist(), rel=0.02)
