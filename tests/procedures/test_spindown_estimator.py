"""The run-down: analytic forms against an integrator, fits recover what made the data, and what T (6.16) leaves out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from bench.errors import AnalysisError
from procedures.spindown import fit
from procedures.spindown.steps import SHORT_LAGS, SMALLEST_SAMPLES, SPEED_LAGS, released

RPM = math.pi / 30
J, B, T_C = 0.033, 0.081, 0.1


@settings(deadline=None)
@given(st.floats(0, 5), st.floats(0, 10), st.floats(5, 80))
def test_the_forms_solve_the_equation(b: float, c: float, start: float) -> None:
    until = 0.9 * min(fit.stopping_time(b, c, start), 3.0)
    t = np.linspace(0, until, 40)
    exact = solve_ivp(lambda _, y: [y[1], -b * y[1] - c], (0, until), [0.0, start], t_eval=t, rtol=1e-11, atol=1e-12).y
    np.testing.assert_allclose(fit.angle(t, b, c, start), exact[0], rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(fit.speed(t, b, c, start), exact[1], rtol=1e-7, atol=1e-7)


@settings(deadline=None)
@given(st.floats(0.01, 5), st.floats(0.01, 10), st.floats(1, 80))
def test_it_stops_when_it_says(b: float, c: float, start: float) -> None:
    t = fit.stopping_time(b, c, start)
    assert fit.speed(np.array([t]), b, c, start)[0] == pytest.approx(0, abs=1e-8 * start)


@settings(deadline=None, max_examples=40)
@given(st.floats(1.5, 4), st.floats(0.3, 6), st.floats(30, 75))
def test_both_fits_give_back_what_made_the_data(b: float, c: float, start: float) -> None:
    t = np.arange(0, 0.8 * fit.stopping_time(b, c, start), 1e-3)
    for coast in (
        fit.of_speed(t, fit.speed(t, b, c, start), 20),
        fit.of_angle(t, 0.3 + fit.angle(t, b, c, start), 20),
    ):
        assert coast.b == pytest.approx(b, rel=1e-5)
        assert coast.c == pytest.approx(c, rel=1e-4)
        assert coast.speed == pytest.approx(start, rel=1e-5)


def test_a_filter_on_the_speed_changes_the_start_alone() -> None:
    b, c, start, keep = B / J, T_C / J, 60.0, math.exp(-2 * math.pi * 20 * 1e-4)
    t = np.arange(0, 1.2, 1e-4)
    w = fit.speed(t, b, c, start)
    seen = np.empty_like(w)
    seen[0] = start
    for k in range(1, len(t)):
        seen[k] = keep * seen[k - 1] + (1 - keep) * w[k]
    later = t > 10 / (2 * math.pi * 20)
    coast = fit.of_speed(t[later] - t[later][0], seen[later], 10)
    assert coast.b == pytest.approx(b, rel=1e-3)
    assert coast.c == pytest.approx(c, rel=1e-2)
    early = fit.of_speed(t, seen, 10)
    assert abs(early.b / b - 1) > 3 * abs(coast.b / b - 1)


def test_the_stated_scatter_is_that_of_a_differentiated_angle() -> None:
    """White noise on the angle, differentiated and filtered at 20 Hz as the controller does it: its variance near zero
    frequency is far below that of its first few lags (which, alone, would state twice the true scatter)."""
    rng, keep, step = np.random.default_rng(8), math.exp(-2 * math.pi * 20 * 1e-3), 1e-3
    t = np.arange(0, 0.95, step)
    w = fit.speed(t, B / J, T_C / J, 50.0)
    found = []
    for _ in range(100):
        blue = lfilter([1 - keep], [1, -keep], np.diff(rng.normal(0, 1e-3, len(t) + 201)) / step)[200:]
        found.append(fit.of_speed(t, w + blue, SPEED_LAGS))
    stated = np.sqrt(np.mean([np.diag(x.covariance) for x in found], axis=0))
    np.testing.assert_allclose(stated, np.std([[x.b, x.c] for x in found], axis=0), rtol=0.3)


@pytest.mark.parametrize(("rpm", "bias"), [(100, 0.33), (200, 0.18), (403, 0.10), (601, 0.07)])
def test_without_coulomb_the_printed_model_is_far_off(rpm: float, bias: float) -> None:
    """Errata of T (6.16): T_c = 0.1 N m; speed sampled evenly from the stated speed to standstill."""
    b, c, start = B / J, T_C / J, rpm * RPM
    t = np.linspace(0, fit.stopping_time(b, c, start), 20_001)
    w = fit.speed(t, b, c, start)
    assert fit.viscous_only(t, w) / b - 1 == pytest.approx(bias, abs=0.006)
    assert fit.of_speed(t, w, 10).b == pytest.approx(b, rel=1e-6)


def test_the_transverse_inertia_is_not_the_polar_one() -> None:
    """Errata of T (6.16): with J = 0.116 kg m^2 as printed B would be 0.285, not 0.081 N m s/rad."""
    t = np.arange(0, 1.0, 1e-3)
    b = fit.of_speed(t, fit.speed(t, B / J, 0.05 / J, 60.0), 10).b
    assert b * J == pytest.approx(0.081, rel=1e-5)
    assert b * 0.116 == pytest.approx(0.285, abs=0.001)


def test_the_scatter_is_what_the_covariance_says() -> None:
    """Counts of an encoder and correlated noise: the stated u is that of repeated fits, within a third."""
    rng = np.random.default_rng(4)
    t = np.arange(0, 1.2, 1e-3)
    b, u = [], []
    for _ in range(60):
        start = rng.uniform(58, 62)
        noise = np.convolve(rng.normal(size=len(t) + 20), np.ones(21) / 21, "valid")
        coast = fit.of_speed(t, fit.speed(t, 2.45, 1.5, start) + 0.2 * noise, 80)
        b.append(coast.b)
        u.append(math.sqrt(coast.covariance[0, 0]))
    assert np.mean(u) == pytest.approx(np.std(b), rel=0.34)


@pytest.mark.parametrize("tau", [0.065, 0.1])
def test_the_stated_scatter_of_a_short_run_down_is_that_of_an_encoders_counts(tau: float) -> None:
    """Over 60 lags of some 250 samples Newey and West's sum would state two thirds of it."""
    rng, count, b, c = np.random.default_rng(7), 2 * np.pi / 4096, 1 / tau, 1.5
    found = []
    for _ in range(150):
        start = rng.uniform(58, 62)
        t = np.arange(0, (math.log(start + c / b) - math.log(3 + c / b)) / b, 1e-3)
        angle = np.floor((fit.angle(t, b, c, start) + rng.uniform(0, count)) / count) * count
        found.append(fit.of_angle(t, angle, SHORT_LAGS, SMALLEST_SAMPLES))
    true = np.std([[x.b, x.c] for x in found], axis=0)
    stated = np.sqrt(np.mean([np.diag(x.covariance) for x in found], axis=0))
    np.testing.assert_allclose(stated, true, rtol=0.2)
    assert np.abs(np.mean([[x.b - b, x.c - c] for x in found], axis=0)).max() < 4 * true.max() / math.sqrt(150)


def test_a_ring_of_known_inertia_gives_the_inertia() -> None:
    assert fit.inertia_from_ring(B / J, B / (J + 0.02), 0.02) == pytest.approx(J, rel=1e-12)
    with pytest.raises(AnalysisError):
        fit.inertia_from_ring(1.0, 2.0, 0.02)


@pytest.mark.parametrize("w", [np.linspace(1, 60, 500), np.full(500, -3.0), np.full(4, 5.0)])
def test_what_is_no_run_down_is_told(w: np.ndarray) -> None:
    with pytest.raises(AnalysisError):
        fit.of_speed(np.arange(len(w)) * 1e-3, w, 10)


def test_a_run_down_begins_where_the_motor_lets_go() -> None:
    """4 A until 0.137 s, and 0.3 ms of the amplifiers. Gains are written one after the other: what is gone for 5 ms only is not
    let go. A step that begins at the release is whole, and so is one in which the motor never lets go: it shows that."""
    noise, k = np.random.default_rng(3).normal(0, 1e-3, 600), np.arange(600)
    torque = np.where(k < 137, 4.0, 4.0 * np.exp(-(k - 137) / 0.3)) + noise
    assert released(torque) == released(-torque) == 138
    assert released(np.where((k > 60) & (k < 66), 0.0, torque)) == 138
    assert released(0.01 + 5 * noise) == released(np.full(600, 4.0)) == released(np.zeros(0)) == 0
