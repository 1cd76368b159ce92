"""Parts of one pooled scatter are counted once and drawn together: against the closed form of a multivariate t."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.calibration import adopted
from bench.uncertainty import Estimate, Influence, correlation, interval, propagate, welch_satterthwaite
from bench.uncertainty.coverage import draw
from procedures.amb_calibration.by_angle import with_scatter
from procedures.amb_calibration.scatter import OUTPUTS


def roots(count: int, dof: float, stem: str = "scatter") -> list[Influence]:
    return [Influence(f"{stem}/{k}", stem, 1.0, "1", "A", "normal", dof) for k in range(count)]


def drawn_sum(some: list[Influence], draws: int = 400_000) -> np.ndarray:
    return np.sum([draw(i, 3, draws) for i in some], axis=0)


@pytest.mark.parametrize(("dof", "t"), [(2.0, 4.3027), (3.0, 3.1824), (14.0, 2.1448)])
def test_roots_of_one_covariance_are_drawn_as_one_multivariate_t(dof: float, t: float) -> None:
    """JCGM 102, 5.3.2: any sum of the parts of a multivariate t is t with the same degrees of freedom. Independent ones would
    give 5.13 at 2 degrees of freedom, 3.32 at 3, 2.12 at 14."""
    low, high = np.quantile(drawn_sum(roots(8, dof)) / math.sqrt(8), [0.025, 0.975])
    assert (high - low) / 2 == pytest.approx(t, rel=0.015)


def test_parts_of_two_covariances_scatter_apart() -> None:
    a, b = drawn_sum(roots(4, 3, "one")), drawn_sum(roots(4, 3, "two"))
    assert abs(np.corrcoef(np.log(a**2), np.log(b**2))[0, 1]) < 0.01
    assert np.corrcoef(np.log(a**2), np.log(drawn_sum(roots(4, 3, "one")[2:]) ** 2))[0, 1] > 0.3


def test_monte_carlo_and_welch_satterthwaite_agree_on_a_sum_of_roots() -> None:
    """The same budget by both: a rectangle that is just large enough for Monte Carlo's interval, and shape does not matter."""
    parts = sum((Estimate.of(0.0, i) for i in roots(8, 4)), Estimate.exact(0.0))
    mild = propagate(lambda p: {"y": p["x"] + 1e-9 * p["x"] ** 2}, {"x": parts})["y"]
    curved = Estimate(mild.value, "", parts.sensitivities, parts.sampled)  # the same linear model, by Monte Carlo
    gum, drawn = interval(mild), interval(curved)
    assert (gum.method, drawn.method) == ("gum", "monte-carlo")
    assert pytest.approx(gum.U, rel=0.015) == drawn.U


@pytest.mark.parametrize("dof", [3.0, 6.0])
def test_many_small_roots_keep_the_tails_of_their_one_covariance(dof: float) -> None:
    """Each root carries under a hundredth of the variance, all of them half of it: they are no normal."""
    bound = Estimate.of(0.0, Influence("r", "r", 12.0, "", "B", "rectangular"))
    total = sum((Estimate.of(0.0, i) for i in roots(120, dof)), bound)
    found = interval(total)
    rng = np.random.default_rng(1)
    oracle = rng.uniform(-12 * 3**0.5, 12 * 3**0.5, 1_000_000) + math.sqrt(120) * rng.standard_t(dof, 1_000_000)
    low, high = np.quantile(oracle, [0.025, 0.975])
    assert found.method == "monte-carlo"
    assert (found.low, found.high) == pytest.approx((low, high), rel=0.015)


def test_the_scatter_of_a_calibration_is_pooled_over_its_angles() -> None:
    """The covariance of a hanging is one estimate: no mean of nine angles knows it nine times as well."""
    values = {name: Estimate.exact(1.0) for o in OUTPUTS for name in (o, *(f"{o}@{k}" for k in range(9)))}
    facts = with_scatter(values, np.tile(np.eye(6), (9, 1, 1)), 34)
    assert welch_satterthwaite(facts["K_i"]) == 34
    assert welch_satterthwaite(facts["K_o@3"] - facts["K_i@7"] * 0.5) == 34
    assert facts["K_i"].u == pytest.approx(1 / 3)


def test_adopted_scatter_stays_one_estimate_and_that_of_another_run_another() -> None:
    values = {name: Estimate.exact(1.0) for o in OUTPUTS for name in (o, *(f"{o}@{k}" for k in range(9)))}
    facts = with_scatter(values, np.tile(np.eye(6), (9, 1, 1)), 34)
    one, two = (adopted(facts, run) for run in ("amb-calibration-1", "amb-calibration-2"))
    assert welch_satterthwaite(one["K_i"] + one["K_o@2"]) == 34
    assert welch_satterthwaite(one["K_i"] + two["K_i"]) == 68
    assert correlation(one["K_i"], two["K_i"]) == 0
    assert correlation(one["K_i"], one["K_i@4"]) == pytest.approx(1 / 3)
    carried = adopted({"a": one["K_i"] * 2}, "force-constant-1", {i.id for e in one.values() for i in e.sensitivities})
    assert correlation(carried["a"], one["K_i"]) == pytest.approx(1.0)
