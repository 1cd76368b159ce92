"""Budgets of what is drawn: each influence has what it moves by itself, by closed forms, and the rest is nobody's."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest

from bench.procedure import Measured, Quantity
from bench.record.records import measurement
from bench.uncertainty import Distribution, Estimate, Influence, budget, interval, propagate
from bench.uncertainty.estimate import Array


def one(name: str, u: float = 1.0, distribution: Distribution = "normal", dof: float = math.inf) -> Estimate:
    return Estimate.of(0.0, Influence(name, name, u, "", "B", distribution, dof))


def shares(estimate: Estimate) -> dict[str, float]:
    found = interval(estimate)
    rows = budget(estimate, found)
    assert found.method == "monte-carlo"
    assert math.fsum(r.share for r in rows) == pytest.approx(
        math.fsum((r.contribution / (found.u or 0)) ** 2 for r in rows)
    )
    return {r.id: r.share for r in rows}


def test_what_bends_has_its_share_where_its_slope_is_nought() -> None:
    """Y = x^2 + y z: of a variance of 3, x has 2 and the product 1, which neither factor has alone. All slopes are 0."""
    inputs = {name: one(name) for name in "xyz"}
    found = shares(propagate(lambda p: p["x"] ** 2 + p["y"] * p["z"], inputs))
    assert found["x"] == pytest.approx(2 / 3, abs=0.03)
    assert found["y"] + found["z"] < 0.005


def test_the_shares_of_ishigami_s_function() -> None:
    """sin x + 7 sin^2 y + 0.1 z^4 sin x, uniform over +-pi: 0.3139, 0.4424, 0, and 0.2437 of x with z (Saltelli, 2008, 4.6)."""
    influences = {name: Influence(name, name, math.pi / math.sqrt(3), "", "B", "rectangular") for name in "xyz"}

    def model(d: Mapping[str, Array]) -> Array:
        return np.asarray(np.sin(d["x"]) * (1 + 0.1 * d["z"] ** 4) + 7 * np.sin(d["y"]) ** 2)

    found = shares(Estimate(0.0, "", {influences["x"]: 1.0, influences["y"]: 0.0, influences["z"]: 0.0}, model))
    assert found["x"] == pytest.approx(0.3139, abs=0.015)
    assert found["y"] == pytest.approx(0.4424, abs=0.015)
    assert found["z"] < 0.005


def test_a_jump_that_is_far_out_is_the_influence_s_that_leaps() -> None:
    """A draw in 500 lies 20 off, as a settling time does that takes another half swing: p (1 - p) 400 of the variance."""
    leaps, quiet = (Influence(name, name, 0.1, "", "B", "normal") for name in ("leaps", "quiet"))
    far, p = 0.1 * 2.878, 0.002

    def model(d: Mapping[str, Array]) -> Array:
        return np.asarray(d["leaps"] + np.where(d["leaps"] > far, 20.0, 0.0) + d["quiet"])

    found = shares(Estimate(0.0, "", {leaps: 1.0, quiet: 1.0}, model))
    assert found["leaps"] > 0.97
    assert found["quiet"] == pytest.approx(0.01 / (400 * p * (1 - p) + 0.02), rel=0.2)
    assert sum(found.values()) == pytest.approx(1.0, abs=0.01)


def test_few_degrees_of_freedom_contribute_what_is_drawn_of_them() -> None:
    """A rectangular part beside one of 5 degrees of freedom: 5/3 of the latter's variance (JCGM 101, 6.4.9.4)."""
    total = one("a", 1.0, "rectangular") + one("few", 0.9, dof=5)
    rows = {r.id: r for r in budget(total, interval(total))}
    assert rows["few"].contribution == pytest.approx(0.9 * math.sqrt(5 / 3))
    assert (rows["few"].u, rows["few"].sensitivity) == (0.9, 1.0)
    assert math.hypot(*(r.contribution for r in rows.values())) == pytest.approx(interval(total).u, rel=0.01)


def test_the_roots_of_one_covariance_are_one_influence_with_parts() -> None:
    roots = [Estimate.of(0.0, Influence(f"scatter/{k}", "scatter", 1.0, "1", "A", "normal", 12.0)) for k in range(2)]
    a, b = roots[0] * 3 + roots[1] * 4, one("b", 2.0, "rectangular")
    found = shares(propagate(lambda p: p["a"] + 0.1 * p["a"] ** 2 + p["b"], {"a": a, "b": b}))
    assert sum(found.values()) == pytest.approx(1.0, abs=0.01)
    assert found["scatter/0"] + found["scatter/1"] == pytest.approx(0.92, abs=0.03)
    assert found["scatter/1"] / found["scatter/0"] == pytest.approx(16 / 9)


def test_a_model_that_is_nearly_linear_keeps_its_budget() -> None:
    """What bends by a fifth of u: |c| u of each, to the draws' scatter."""
    bent = propagate(lambda p: p["a"] + 2 * p["b"] + 0.2 * p["a"] ** 2, {"a": one("a"), "b": one("b")})
    found = shares(bent)
    assert found["b"] == pytest.approx(4 / 5.08, abs=0.02)
    assert found["a"] == pytest.approx(1.08 / 5.08, abs=0.02)


def test_the_interval_alone_leaves_the_linear_budget() -> None:
    few = one("few", dof=2) + one("wide", 3.0, "rectangular")
    assert interval(few).u is None
    assert [r.contribution for r in budget(few, interval(few))] == [3.0, 1.0]


def test_a_record_has_what_two_results_share_beside_what_each_contributes() -> None:
    inputs = {name: one(name) for name in "xyz"}
    entry = measurement(
        Measured(Quantity("q", "1", ""), propagate(lambda p: p["x"] ** 2 + p["y"] * p["z"], inputs)), None
    )
    assert entry.together == pytest.approx((entry.standard_uncertainty or 0) / math.sqrt(3), rel=0.05)
    assert entry.variance == pytest.approx((entry.standard_uncertainty or 0) ** 2)
    assert {e.influence: e.linear for e in entry.budget} == pytest.approx({"x": 0.0, "y": 0.0, "z": 0.0}, abs=1e-9)
    assert {e.standard_uncertainty for e in entry.budget} == {1.0}
