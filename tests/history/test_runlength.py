"""Run lengths against published tables: known parameters, a drift, and parameters estimated from a baseline."""

from __future__ import annotations

import math
from itertools import repeat

import numpy as np
import pytest
from scipy import special

from bench.history.charts import ewma, ewma_sigmas, individuals
from bench.history.runlength import average_run_length, baseline, no_signal, survival


@pytest.mark.parametrize(
    ("weight", "shift", "printed"),
    [(0.5, 0.0, 26.45), (0.5, 0.25, 20.12), (0.5, 1.0, 4.91), (0.5, 4.0, 1.05),
     (0.05, 0.0, 127.53), (0.05, 0.25, 43.94), (0.05, 1.0, 8.38), (0.05, 4.0, 2.15)],
)  # fmt: skip
def test_average_run_lengths_of_crowder(weight: float, shift: float, printed: float) -> None:
    """Crowder, Technometrics 29, 401 (1987), table 1: fixed limits of two standard deviations."""
    assert round(average_run_length(weight, shift=shift, width=2.0), 2) == printed


def test_average_run_length_of_the_sas_manual() -> None:
    """SAS/QC: 11.154267016 for weight 0.25, three standard deviations, a shift of one."""
    assert average_run_length(0.25, shift=1.0) == pytest.approx(11.154267016, abs=5e-10)


def test_average_run_lengths_of_lucas_and_saccucci() -> None:
    """Technometrics 32, 1 (1990), table 3, three digits."""
    for shift, printed in ((0.25, 76.7), (1.0, 12.6), (3.0, 4.03)):
        assert average_run_length(0.03, shift=shift, width=2.437) == pytest.approx(printed, rel=5e-3)


def test_individuals_chart_is_the_one_of_weight_one() -> None:
    outside = math.erfc(3 / math.sqrt(2))
    assert average_run_length(1.0) == pytest.approx(1 / outside, rel=1e-9)
    assert [float(s[0]) for s in survival(repeat(0.0, 3), 1.0)] == pytest.approx(
        [(1 - outside) ** k for k in (1, 2, 3)]
    )


@pytest.mark.parametrize(("slope", "drawn"), [(1.0, 3.688), (0.5, 5.318), (0.1, 12.986)])
def test_run_length_under_drift(slope: float, drawn: float) -> None:
    """Ten thousand times ten thousand histories drawn by Knoth (R package spc, xDewma.arl): weight 0.1, width 2.7."""
    assert average_run_length(0.1, slope=slope, width=2.7) == pytest.approx(drawn, abs=6e-4)


def test_run_length_under_drift_of_aerne() -> None:
    """Aerne, Champ and Rigdon (1991), table I: weight 0.25, width 2.974."""
    for slope, printed in ((1.0, 3.27), (0.421697, 5.38), (0.1, 13.16)):
        assert average_run_length(0.25, slope=slope, width=2.974) == pytest.approx(printed, abs=6e-3)


def test_exact_limits_see_a_change_at_the_start_sooner() -> None:
    """Steiner (1999), table 2, by his approximation: 9.0 in place of 13.5 for weight 0.05, width 3, shift 1."""
    assert average_run_length(0.05, shift=1.0) == pytest.approx(13.5, abs=0.1)
    assert average_run_length(0.05, shift=1.0, exact=True) == pytest.approx(9.0, abs=0.3)


def test_run_lengths_with_estimated_parameters() -> None:
    """Jones, Champ and Rigdon, Technometrics 43, 156 (2001), table 1: 20 samples of five, weight 0.2, width 2.636 over c4. The
    average of no change is 144.458 +- 0.022 by 1e8 histories that Knoth drew (R package spc, xewma.arl.prerun)."""
    groups, dof = 20, 80
    x, w = np.polynomial.hermite_e.hermegauss(61)
    s, v = special.roots_genlaguerre(24, dof / 2 - 1)
    c4 = math.sqrt(2 / dof) * math.exp(special.gammaln((dof + 1) / 2) - special.gammaln(dof / 2))
    centre, sigma = (a.ravel() for a in np.meshgrid(x / math.sqrt(groups), np.sqrt(2 * s / dof) / c4, indexing="ij"))
    weights = np.outer(w / w.sum(), v / v.sum()).ravel()
    for shift, printed in ((0.0, (13, 73, 345)), (0.5, (6, 20, 101)), (1.0, (3, 7, 18)), (2.0, (2, 3, 5))):
        left = list(survival(repeat(shift, 60), 0.2, width=2.636, exact=False, centre=centre, sigma=sigma))
        ratio = left[-1] / np.maximum(left[-2], 1e-300)  # geometric by then, for each pair of estimates
        left += [left[-1] * ratio**k for k in range(1, 400)]
        reached = 1 - np.array([float(weights @ one) for one in left])
        # 1e-5: 345 has 0.899994, which the paper's own numbers round
        assert [int(np.argmax(reached >= p - 1e-5)) + 1 for p in (0.1, 0.5, 0.9)] == list(printed)
        if shift == 0:
            average = weights @ (1 + np.sum(left[:60], axis=0) + left[59] * ratio / (1 - ratio))
            assert average == pytest.approx(144.458, abs=3 * 0.022)


@pytest.mark.parametrize("runs", [8, 20])
def test_a_baseline_has_the_exact_mean_and_variance_of_its_moving_range(runs: int) -> None:
    """Of neighbours |x - y|, |y - z| with the correlation -1/2 that their differences have; the mean is independent of them."""
    centres, sigmas, weights = baseline(runs)
    assert weights.sum() == pytest.approx(1)
    assert weights @ centres**2 == pytest.approx(1 / runs)
    mean, variance = 2 / math.sqrt(math.pi), 2 - 4 / math.pi
    together = 4 / math.pi * (math.sqrt(0.75) - 0.5 * math.asin(-0.5)) - 4 / math.pi
    exact = ((runs - 1) * variance + 2 * (runs - 2) * together) / (runs - 1) ** 2
    assert weights @ sigmas * 1.128 == pytest.approx(mean, rel=2e-3)
    assert weights @ (sigmas * 1.128 - mean) ** 2 == pytest.approx(exact, rel=1e-2)


@pytest.mark.parametrize(("weight", "slope"), [(1.0, 0.0), (0.2, 0.0), (1.0, 1.0), (0.2, 1.0)])
def test_signals_of_drawn_histories_with_limits_from_eight_runs(weight: float, slope: float) -> None:
    """60 000 histories with the charts as they are drawn: as many signals within any number of runs, by the 99.9 % band."""
    rng = np.random.default_rng(11)
    count, runs, watched = 60_000, 8, 12
    drift = slope * np.arange(1, watched + 1)
    x = rng.standard_normal((count, runs + watched)) + np.concatenate([np.zeros(runs), drift])
    centre, sigma = x[:, :runs].mean(axis=1), np.abs(np.diff(x[:, :runs])).mean(axis=1) / 1.128
    z, inside, drawn = centre.copy(), np.ones(count, bool), []
    for k, size in enumerate(ewma_sigmas(weight, watched)):
        z = weight * x[:, runs + k] + (1 - weight) * z
        inside &= np.abs(z - centre) <= 3 * sigma * size
        drawn.append(inside.mean())
    expected = np.array(no_signal(drift.tolist(), weight, runs))
    band = 3.3 * np.sqrt(expected * (1 - expected) / count) + 1e-4
    assert (np.abs(np.array(drawn) - expected) < band).all()
    first = individuals(x[0, :runs])
    assert (first.centre, first.sigma) == pytest.approx((centre[0], sigma[0]))
    assert ewma(x[0, runs:], weight, first.centre)[-1] == pytest.approx(z[0])


def test_a_baseline_of_two_runs_says_nothing() -> None:
    with pytest.raises(ValueError, match="baseline of 2 runs"):
        baseline(2)
