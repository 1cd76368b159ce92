"""Intervals, budgets and series: golden numbers and small coverage checks."""

from __future__ import annotations

import math

import GTC
import numpy as np
import pytest
from scipy import optimize, special

from bench.analysis.vectors import estimates
from bench.errors import AnalysisError
from bench.uncertainty import (
    Estimate,
    Influence,
    batch_means,
    budget,
    coverage_factor,
    interval,
    propagate,
    round_to_uncertainty,
    stated,
    welch_satterthwaite,
)
from bench.uncertainty.coverage import draw
from procedures.shared import leastsquares
from procedures.shared.type_a import scatter


def estimate(identity: str, value: float, u: float, dof: float = math.inf, distribution: str = "normal") -> Estimate:
    return Estimate.of(value, Influence(identity, identity, u, "", "B", distribution, dof))  # type: ignore[arg-type]


def test_end_gauge_of_the_gum() -> None:
    # JCGM 100:2008, H.1: nm and degrees of freedom; u_c = 32 nm, nu_eff = 16 (H.1.6 prints 16 from rounded terms).
    parts = ((25.0, 18.0), (5.8, 24.0), (3.9, 5.0), (6.7, 8.0), (2.9, 50.0), (16.6, 2.0))
    total = sum((estimate(str(k), 0.0, u, nu) for k, (u, nu) in enumerate(parts)), Estimate.exact(0.0))
    assert total.u == pytest.approx(31.7, abs=0.1)
    assert welch_satterthwaite(total) == 16
    assert interval(total).k == pytest.approx(2.12, abs=0.005)


@pytest.mark.parametrize(("dof", "k"), [(1, 12.706), (8, 2.306), (20, 2.086), (math.inf, 1.95996)])
def test_coverage_factors_of_table_g2(dof: float, k: float) -> None:
    assert coverage_factor(dof) == pytest.approx(k, abs=5e-4)


def test_effective_degrees_of_freedom_truncate_down_and_survive_tiny_numbers() -> None:
    both = estimate("a", 0.0, 1e-90, 5) + estimate("b", 0.0, 0.5e-90, 7)
    assert welch_satterthwaite(both) == math.floor(1.25**2 / (1 / 5 + 0.5**4 / 7))
    assert welch_satterthwaite(estimate("a", 0.0, 0.3, 49)) == 49
    assert welch_satterthwaite(Estimate.exact(1.0)) == math.inf


def test_what_a_fit_gives_has_its_degrees_of_freedom_and_no_more() -> None:
    """Intercept, slope and any sum of them scatter with the same residuals: GTC's ensemble of a line's parameters."""
    x = np.arange(8.0)
    y = 1 + 2 * x + np.array([0.1, -0.2, 0.05, 0.1, -0.1, 0.2, -0.1, -0.05])
    a, b = GTC.type_a.line_fit(x, y).a_b
    fit = leastsquares.linear(np.column_stack([np.ones(8), x]), y)
    ours = scatter(fit, {"a": [1, 0], "b": [0, 1]}, "line", "scatter")
    for oracle, found in (
        (b, ours["b"]),
        (a + 20 * b, ours["a"] + ours["b"] * 20.0),
        (a + 2 * b, ours["a"] + ours["b"] * 2.0),
    ):
        assert found.u == pytest.approx(GTC.uncertainty(oracle), rel=1e-9)
        assert welch_satterthwaite(found) == round(GTC.dof(oracle)) == 6


def test_a_vectors_components_share_the_degrees_of_freedom_of_their_batches() -> None:
    re, im = estimates([3.0, 4.0], np.array([[0.04, 0.01], [0.01, 0.09]]), "scatter/dwell/1", "scatter", "m", 14.0)
    assert welch_satterthwaite(re * 0.6 + im * 0.8) == 14
    other = estimate("b", 0.0, (re * 0.6 + im * 0.8).u, 5)
    assert welch_satterthwaite(re * 0.6 + im * 0.8 + other) == math.floor(4 / (1 / 14 + 1 / 5))


def test_a_dominant_rectangle_goes_to_monte_carlo() -> None:
    found = interval(estimate("r", 5.0, 1.0, distribution="rectangular"))
    assert found.method == "monte-carlo"
    assert "rectangular component r" in found.why
    assert (found.low, found.high) == pytest.approx((5 - 0.95 * 3**0.5, 5 + 0.95 * 3**0.5), abs=0.01)
    assert found.k == pytest.approx(1.645, abs=0.01)


@pytest.mark.parametrize("share", [0.55, 0.7, 0.8, 0.9, 0.95])
def test_k_of_a_rectangle_and_a_normal_is_that_of_their_sum(share: float) -> None:
    """P(|R + N| <= U) = 0.95 by quadrature over the rectangle of half width 1; k goes from 1.65 to 1.92, and is never 2."""
    sigma = math.sqrt((1 - share) / (3 * share))
    at = np.linspace(-1, 1, 2001)

    def within(half: float) -> float:
        return float(np.mean(special.ndtr((half - at) / sigma) - special.ndtr((-half - at) / sigma)))

    half = optimize.brentq(lambda x: within(x) - 0.95, 0.5, 3.0)
    found = interval(estimate("r", 0.0, 1 / math.sqrt(3), distribution="rectangular") + estimate("n", 0.0, sigma))
    assert pytest.approx(half, rel=0.006) == found.U
    assert 1.65 < found.U / math.hypot(1 / math.sqrt(3), sigma) < 1.92


def test_half_of_the_variance_is_the_border() -> None:
    normal = estimate("n", 0.0, 1.0)
    assert interval(normal + estimate("r", 0.0, 0.99, distribution="rectangular")).method == "gum"
    assert interval(normal + estimate("r", 0.0, 1.01, distribution="rectangular")).method == "monte-carlo"


def test_monte_carlo_is_seeded_and_independent_of_order() -> None:
    r, n = estimate("r", 0.0, 1.0, distribution="rectangular"), estimate("n", 0.0, 0.2, 9)
    assert interval(r + n, 3) == interval(r + n, 3)
    assert interval(r + n, 3).low == pytest.approx(interval(n + r, 3).low, rel=1e-12)
    assert interval(r + n, 3) != interval(r + n, 4)


@pytest.mark.parametrize(
    "small", [("normal", math.inf), ("normal", 6.0), ("rectangular", math.inf), ("arcsine", math.inf)]
)
def test_what_is_small_may_be_drawn_as_one_normal(small: tuple[str, float]) -> None:
    # Oracle: every influence drawn by itself.
    parts = [estimate("r", 2.0, 1.0, distribution="rectangular"), estimate("t", 0.0, 0.4, 5)]
    parts += [estimate(f"s{k}", 0.0, 0.095, small[1], small[0]) for k in range(60)]
    total = sum(parts, Estimate.exact(0.0))
    found = interval(total)
    alone = total.sampled({i.id: draw(i, 7, 400_000) for i in total.sensitivities})
    assert found.method == "monte-carlo"
    assert (found.low, found.high) == pytest.approx(tuple(np.quantile(alone, [0.025, 0.975])), abs=0.008 * found.U)


def test_a_square_gets_the_interval_of_chi_squared() -> None:
    square = propagate(lambda p: p["x"] ** 2, {"x": estimate("x", 0.0, 1.0)})
    found = interval(square + 1)
    assert found.method == "monte-carlo"
    assert found.low == pytest.approx(1.00098, abs=2e-4)
    assert found.high == pytest.approx(6.0239, abs=0.08)


def test_a_model_without_an_expansion_is_asked_for_a_bounded_number_of_draws() -> None:
    """JCGM 101, 7.9: until the ends are known, with a stated end. The positive part of a normal is known in closed form."""
    calls = [0]

    def positive(p: dict[str, float]) -> float:
        calls[0] += 1
        return max(p["x"], 0.0)

    found = interval(propagate(positive, {"x": estimate("x", 0.0, 1.0)}) + estimate("z", 0.0, 1e-3))
    assert found.method == "monte-carlo"
    assert "draws" in found.why
    assert found.high == pytest.approx(1.95996, rel=0.04)
    assert calls[0] < 21_000


@pytest.mark.parametrize("distribution", ["normal", "rectangular", "triangular", "arcsine"])
def test_draws_have_the_stated_standard_uncertainty(distribution: str) -> None:
    drawn = draw(Influence("x", "x", 0.3, "", "B", distribution), 1, 100_000)  # type: ignore[arg-type]
    assert drawn.std() == pytest.approx(0.3, rel=0.01)
    assert drawn.mean() == pytest.approx(0.0, abs=0.005)
    width = {"normal": 4.0, "rectangular": 3**0.5, "triangular": 6**0.5, "arcsine": 2**0.5}[distribution]
    assert np.abs(drawn).max() / 0.3 == pytest.approx(width, rel=0.25 if distribution == "normal" else 0.01)


def test_numbers_that_are_not_finite_have_no_interval() -> None:
    with pytest.raises(AnalysisError):
        interval(estimate("a", math.nan, 1.0))


def test_exact_values_have_an_interval_of_no_width() -> None:
    found = interval(Estimate.exact(2.0))
    assert (found.low, found.high, found.U, found.method) == (2.0, 2.0, 0.0, "gum")


def test_batch_means_cover_an_ar1_series() -> None:
    rng = np.random.default_rng(5)
    runs, n, phi = 400, 4000, 0.9
    x = np.zeros((runs, n))
    noise = rng.standard_normal((runs, n))
    x[:, 0] = noise[:, 0] / math.sqrt(1 - phi**2)
    for k in range(1, n):
        x[:, k] = phi * x[:, k - 1] + noise[:, k]
    means = [batch_means(row) for row in x]
    hits = sum(abs(m.value) <= coverage_factor(m.dof) * m.u for m in means)
    assert hits / runs == pytest.approx(0.95, abs=3.3 * math.sqrt(0.95 * 0.05 / runs))
    naive = sum(abs(row.mean()) <= 1.96 * row.std() / math.sqrt(n) for row in x)
    assert naive / runs < 0.6  # what the method is for


@pytest.mark.parametrize("series", [np.ones(31), np.ones((4, 40)), np.r_[np.ones(50), np.nan]])
def test_batch_means_refuse_what_they_cannot_use(series: np.ndarray) -> None:
    with pytest.raises(AnalysisError):
        batch_means(series)


def test_batch_means_golden() -> None:
    found = batch_means([9.0, 1.0, 3.0, 5.0, 7.0], batches=2)
    assert (found.value, found.dof) == (5.0, 1.0)
    assert found.u == pytest.approx(2.0)


def test_budget_is_sorted_and_its_shares_add_up() -> None:
    rows = budget(2 * estimate("a", 1.0, 0.1) - 30 * estimate("b", 1.0, 0.1, 7) + estimate("c", 0.0, 0.1))
    assert [r.id for r in rows] == ["b", "a", "c"]
    assert (rows[0].sensitivity, rows[0].dof) == (-30.0, 7)
    assert rows[0].contribution == pytest.approx(3.0)
    assert math.fsum(r.share for r in rows) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("value", "expanded", "text"),
    [
        (73.21478, 0.1234, ("73.21", "0.12")),
        (73.21478, 0.0996, ("73.21", "0.10")),
        (73.21478, 4.44, ("73.2", "4.4")),
        (7321.478, 1234.0, ("7300", "1200")),
        (-0.000012344, 3.21e-7, ("-0.00001234", "0.00000032")),
        (1.0, 0.0, ("1.0", "0.0")),
        (np.float64(73.21478), np.float64(0.1234), ("73.21", "0.12")),
    ],
)
def test_rounding(value: float, expanded: float, text: tuple[str, str]) -> None:
    assert round_to_uncertainty(value, expanded) == text


@pytest.mark.parametrize(
    ("value", "expanded", "text"),
    [
        (73.21478, 0.1234, "73.21 +- 0.12"),
        (2.7e-7, 1.2e-8, "(270 +- 12)e-9"),
        (2.7e-7, 1.2e-7, "(2.7 +- 1.2)e-7"),
        (-0.000012344, 3.21e-7, "(-12.34 +- 0.32)e-6"),
        (7321.478, 1234.0, "(7.3 +- 1.2)e3"),
        (1.62e8, 3.4e5, "(162.00 +- 0.34)e6"),
        (0.0, 5e-9, "(0.0 +- 5.0)e-9"),
        (0.0042, 0.00013, "0.00420 +- 0.00013"),
        (1.0, 0.0, "1.0 +- 0.0"),
        (np.float64(2.7e-7), np.float64(1.2e-8), "(270 +- 12)e-9"),
    ],
)
def test_a_result_on_one_line(value: float, expanded: float, text: str) -> None:
    assert stated(value, expanded) == text


def test_where_the_interval_is_by_monte_carlo_the_standard_uncertainty_is_too() -> None:
    """JCGM 101, 7.6: the standard deviation of the draws, not of a linear model that does not hold."""
    square = propagate(lambda p: p["x"] ** 2, {"x": estimate("x", 0.1, 1.0)})
    found = interval(square)
    assert square.u == pytest.approx(0.2)
    assert found.u == pytest.approx(math.sqrt(2 + 4 * 0.01), rel=0.02)
    assert found.k is not None
    assert found.k == pytest.approx(found.U / found.u)


@pytest.mark.parametrize("dof", [1.0, 2.0])
def test_with_two_degrees_of_freedom_or_fewer_the_interval_alone_is_stated(dof: float) -> None:
    few = estimate("few", 5.0, 0.1, dof)
    plain = interval(few)
    assert (plain.u, plain.k) == (None, None)
    assert pytest.approx(coverage_factor(dof) * 0.1) == plain.U
    drawn = interval(propagate(lambda p: p["x"] ** 2, {"x": few}) + estimate("r", 0.0, 9.0, distribution="rectangular"))
    assert drawn.method == "monte-carlo"
    assert (drawn.u, drawn.k) == (None, None)
    assert interval(estimate("more", 5.0, 0.1, 3.0)).u == 0.1


def test_a_distribution_without_a_standard_deviation_has_none() -> None:
    """A denominator that may be zero: one draw makes the sum of squares."""
    found = interval(estimate("a", 1.0, 0.1) / estimate("b", 1.0, 0.4))
    assert found.method == "monte-carlo"
    assert (found.u, found.k) == (None, None)
    assert "no standard deviation" in found.why


@pytest.mark.parametrize(("value", "expanded"), [(1e20, 1e-9), (-3.3e40, 2.0), (1e300, 1e-300), (5e-324, 5e-324)])
def test_rounding_holds_however_far_value_and_uncertainty_lie_apart(value: float, expanded: float) -> None:
    low, high = round_to_uncertainty(value, expanded)
    assert float(low) == pytest.approx(value)
    assert float(high) == pytest.approx(expanded, rel=0.05)
    assert stated(value, expanded)
