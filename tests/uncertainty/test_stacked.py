"""A model of stacks is propagated as the same model of single numbers is."""

from __future__ import annotations

import numpy as np
import pytest

from bench.errors import AnalysisError
from bench.uncertainty import Estimate, Influence, propagate, propagate_stacked
from bench.uncertainty.estimate import Array
from bench.uncertainty.propagation import STACK


def inputs(count: int) -> dict[str, Estimate]:
    """Values about 1 with an influence of their own each, and one that all of them share."""
    shared = Estimate.of(0.0, Influence("shared", "shared", 0.01, "", "B", "rectangular"))
    own = (Influence(f"own/{k}", "own", 0.02 + 0.001 * k, "", "A", "normal", 9.0) for k in range(count))
    return {f"x{k}": Estimate.of(1 + 0.1 * k, i) + shared for k, i in enumerate(own)}


def model(v: dict[str, Array]) -> dict[str, Array]:
    """One output that is straight, one that bends between two inputs near zero."""
    return {"straight": sum(v.values()) / v["x0"], "bent": (v["x0"] - 1.0) * (v["x1"] - 1.1)}  # type: ignore[dict-item]


def test_a_stacked_model_gives_what_the_same_model_gives_one_by_one() -> None:
    for count in (2, STACK):  # more sets of moved inputs than go into one stack
        known = inputs(count)
        stacked = propagate_stacked(model, known)
        single = propagate(lambda v: {n: float(y) for n, y in model(v).items()}, known)  # type: ignore[arg-type]
        assert [e.nonlinear for e in stacked.values()] == [False, True] == [e.nonlinear for e in single.values()]
        drawn = {f"own/{k}": np.linspace(-0.1, 0.1, 7) * (1 + k) for k in range(count)} | {"shared": np.full(7, 0.003)}
        for name, e in single.items():
            assert stacked[name].value == e.value
            assert stacked[name].contributions == pytest.approx(e.contributions, rel=1e-12, abs=1e-15)
            assert stacked[name].sampled(drawn) == pytest.approx(e.sampled(drawn), rel=1e-12)


def test_slopes_of_a_stack_are_the_derivatives() -> None:
    known = {"a": Estimate.of(3.0, Influence("a", "a", 1e-4, "", "B", "normal")),
             "b": Estimate.of(2.0, Influence("b", "b", 1e-4, "", "B", "normal"))}  # fmt: skip
    e = propagate_stacked(lambda v: {"y": v["a"] ** 2 / v["b"]}, known)["y"]
    assert {i.id: c for i, c in e.sensitivities.items()} == pytest.approx({"a": 3.0, "b": -9 / 4}, rel=1e-7)


def test_one_number_of_a_stack_that_is_not_finite_is_refused_by_the_outputs_name() -> None:
    with pytest.raises(AnalysisError, match="the model gives inf for y"):
        propagate_stacked(lambda v: {"y": np.where(v["x0"] > 1.015, np.inf, v["x0"])}, inputs(3))
