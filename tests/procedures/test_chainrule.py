"""Propagation by inputs agrees with propagation by influences."""

from __future__ import annotations

import math

import pytest

from bench.uncertainty import Estimate, Influence, correlation, propagate
from procedures.shared.gradients import by_inputs


def one(name: str, u: float) -> Influence:
    return Influence(name, name, u, "1", "B", "rectangular")


def test_shared_influences_keep_their_identity() -> None:
    shared, a, b = one("gain", 0.01), one("a", 0.02), one("b", 0.005)
    inputs = {
        "x": Estimate(2.0, "", {shared: 2.0, a: 1.0}),
        "y": Estimate(3.0, "", {shared: -1.5, b: 1.0}),
        "z": Estimate.exact(4.0),
    }

    def model(p: dict[str, float]) -> dict[str, float]:
        return {"ratio": p["x"] / p["y"] * p["z"], "sum": p["x"] + math.sin(p["y"])}

    mine, theirs = by_inputs(model, inputs), propagate(model, inputs)
    for name in mine:
        assert mine[name].value == theirs[name].value
        assert mine[name].u == pytest.approx(theirs[name].u, rel=1e-3)
        assert {i.id for i in mine[name].sensitivities} == {"gain", "a", "b"}
    assert correlation(mine["ratio"], mine["sum"]) == pytest.approx(
        correlation(theirs["ratio"], theirs["sum"]), abs=1e-3
    )


def test_a_bent_model_is_propagated_in_full() -> None:
    out = by_inputs(lambda p: {"square": p["x"] ** 2}, {"x": Estimate.of(0.0, one("a", 1.0))})
    assert out["square"].nonlinear
