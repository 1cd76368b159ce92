"""The torque balance: exact on exact steps, drift and detent drop out, and what T's equation without gravity would give."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.errors import AnalysisError
from procedures.torque_constant import fit, hypotheses
from procedures.torque_constant.fit import NO_DETENT, Steps, balance, detent
from procedures.torque_constant.plan import Plan
from procedures.torque_constant.procedure import visits

Array = npt.NDArray[np.float64]
KG = np.array([0.5, 1.0, 2.0, 0.0])
P = {"gravity": 9.81, "air_density": 1.2, "mass_density": 8000.0, "lever_left": 0.23, "lever_right": 0.23,
     "mass_0": 0.5, "mass_1": 1.0, "mass_2": 2.0, **{f"gain_{k}": 1.0 for k in range(1, 5)}}  # fmt: skip
SIDES = np.array([0, 1, 1, 1, 0, -1, -1, -1, 0])
LOADS = np.array([-1, 0, 1, 2, -1, 0, 1, 2, -1])
EDGE = 1.5 * 2 * math.pi / 4096


def made(
    alpha: float,
    gamma_0: float,
    base: float = 0.0,
    drift: float = 0.0,
    noise: float = 0.0,
    seed: int = 0,
    ripple: float = 0.0,
    scale: Callable[[Array], Array] = np.zeros_like,
) -> Steps:
    """Steps of a machine with constants as given, at five phase angles as the procedure visits them; loaded it rests on the
    edge of a count; `scale` is the relative drift of its torque per current over the run from 0 to 1."""
    gammas = np.repeat(visits(Plan(gamma_max_rad=0.087)), len(SIDES))
    side, load = np.tile(SIDES, 5), np.tile(LOADS, 5)
    time = np.arange(len(side)) * 1.3
    torque = side * KG[load] * 9.81 * 0.23 * (1 - 1.2 / 8000)
    turn, angle = 8 * (gammas - gamma_0), EDGE * side
    per = alpha * ((1 - ripple) * np.cos(turn) + ripple * np.cos(turn + 48 * angle)) * (1 + scale(time / time[-1]))
    current = -torque / per + base + drift * time
    current = current + noise * np.random.default_rng(seed).normal(size=len(side))
    return Steps(np.repeat(current[:, None], 4, axis=1), angle, gammas, time, side, load, np.zeros(len(side)))


@settings(deadline=None, max_examples=40)
@given(st.floats(1, 5), st.floats(-0.02, 0.02), st.floats(-1, 1), st.floats(-1e-3, 1e-3))
def test_constants_are_found_whatever_is_constant_or_drifts(
    alpha: float, gamma_0: float, base: float, drift: float
) -> None:
    found = balance(made(alpha, gamma_0, base, drift), P, 3, 8.0)
    assert found.alpha == pytest.approx(alpha, rel=1e-7)
    assert found.gamma_0 == pytest.approx(gamma_0, abs=1e-8)


def test_the_phase_angles_lie_evenly_about_the_middle_of_the_run() -> None:
    for count in range(5, 13):
        found = visits(Plan(gammas=count))
        assert sorted(found) == pytest.approx(list(np.linspace(-0.0873, 0.0873, count)))
        assert found == pytest.approx([-g for g in reversed(found)])
        weight = np.tan(8 * np.array(found)) / np.cos(8 * np.array(found)) ** 2
        ascending = np.sort(weight) @ np.arange(count)
        assert abs(weight @ np.arange(count)) < 0.2 * abs(ascending)


@pytest.mark.parametrize("size", [-0.003, 0.001])
def test_a_scale_that_drifts_evenly_in_time_is_found_and_drops_out(size: float) -> None:
    found = balance(made(2.87, 0.003, ripple=0.005, scale=lambda t: size * (t - 0.5)), P, 3, 8.0)
    assert found.drift.value == pytest.approx(size, rel=0.01)
    assert found.gamma_0 == pytest.approx(0.003, abs=1e-9)
    assert abs(found.alpha / 2.87 - 1) < 0.02 * abs(size)  # heavy loads hang a little later than the middle of the run


def test_a_scale_that_warms_up_is_seen_before_it_moves_gamma_0() -> None:
    """0.1 % with a time constant of 0.4 of the run: gamma_0 moves by less than 5e-6 rad, half of its U with the default plan.
    In ascending order and without the drift among the terms it would be 6e-5 rad."""
    found = balance(made(2.87, 0.003, scale=lambda t: 1e-3 * (1 - np.exp(-t / 0.4))), P, 3, 8.0)
    assert found.drift.value == pytest.approx(8e-4, rel=0.2)
    assert abs(found.gamma_0 - 0.003) < 5e-6


def test_the_scatter_is_what_the_covariance_says() -> None:
    fits = [balance(made(2.87, 0.003, noise=1e-3, seed=k), P, 3, 8.0) for k in range(150)]
    for k, values in enumerate(([f.alpha for f in fits], [f.gamma_0 for f in fits])):
        assert np.std(values) == pytest.approx(np.mean([math.sqrt(f.covariance[k, k]) for f in fits]), rel=0.2)


def test_steps_that_jump_count_less_and_the_scatter_stays_honest() -> None:
    """A third of the steps is ten times worse, and their spread tells: u is that of repeated fits, and below the unweighted."""
    errors, u, plain = [], [], []
    for seed in range(120):
        s = made(2.87, 0.003)
        rng = np.random.default_rng(seed)
        bad = rng.random(len(s.side)) < 0.33
        noise = np.where(bad, 2e-3, 2e-4) * rng.normal(size=len(s.side))
        s = Steps(s.segments + noise[:, None], s.angle, s.gamma, s.time, s.side, s.load, np.where(bad, 0.2, 0.01))
        first = balance(s, P, 3, 8.0)
        found = balance(s, P, 3, 8.0, u=fit.uneven(first, s))
        errors.append(found.gamma_0 - 0.003)
        u.append(math.sqrt(found.covariance[1, 1]))
        plain.append(math.sqrt(first.covariance[1, 1]))
    assert np.mean(u) == pytest.approx(np.std(errors), rel=0.35)
    assert np.mean(u) < 0.7 * np.mean(plain)


def test_the_scatter_of_a_step_is_not_that_of_its_residual() -> None:
    """Fourteen terms follow 45 steps: the squares of the residuals are 31/45 of the steps' own, their leverage says where."""
    found, s = [], made(2.87, 0.003)
    for seed in range(200):
        noise = 2e-4 * np.random.default_rng(seed).normal(size=len(s.side))
        steps = replace(s, segments=s.segments + noise[:, None])
        found.append(np.mean((fit.uneven(balance(steps, P, 3, 8.0), steps) / 2e-4) ** 2))
    assert np.mean(found) == pytest.approx(1.0, abs=0.06)


def test_weights_from_the_residuals_cost_a_degree_of_freedom() -> None:
    s = made(2.87, 0.003, noise=1e-3)
    plain = balance(s, P, 3, 8.0)
    assert balance(s, P, 3, 8.0, u=fit.uneven(plain, s)).dof == plain.dof - 1 == len(s.side) - 15


def test_gains_and_offsets_of_the_sensors() -> None:
    """A gain of a segment counts a quarter; an offset of any size does nothing."""
    s = made(2.87, 0.0)
    wrong = Steps(
        s.segments * [1.004, 1, 1, 1] + [0.02, -0.01, 0, 0.03], s.angle, s.gamma, s.time, s.side, s.load, s.spread
    )
    assert balance(wrong, P, 3, 8.0).alpha == pytest.approx(2.87 / 1.001, rel=1e-6)
    assert balance(wrong, {**P, "gain_1": 1.004}, 3, 8.0).alpha == pytest.approx(2.87, rel=1e-6)


def test_gravity_is_missing_in_print() -> None:
    """Errata of T 6.6.4: m l = alpha_tau cos(M gamma) i gives 0.29 instead of 2.87, and is no torque."""
    s = made(2.87, 0.0)
    literal = balance(s, {**P, "gravity": 1.0}, 3, 8.0).alpha
    assert literal == pytest.approx(2.87 / 9.81, rel=1e-6)


def test_a_baseline_is_needed_against_detent() -> None:
    """Errata of T 6.6.4: m g l = alpha_tau cos(M gamma) i, fitted to one side as printed, takes 50 mA of offset for load."""
    s = made(2.87, 0.0, base=0.05)
    left = s.side > 0
    torque = fit.load_torque(s, P, 3)[left]
    current = -s.segments[left, 0] * np.cos(8 * s.gamma[left])
    literal = float(torque @ torque / (torque @ current))
    assert abs(literal / 2.87 - 1) > 0.03
    assert balance(s, P, 3, 8.0).alpha == pytest.approx(2.87, rel=1e-7)


def test_five_degrees_cost_about_a_quarter() -> None:
    """T Fig. 6.6(a): about 23 % less torque per current at 5.03 deg."""
    gamma = math.radians(5.03)
    s = made(2.87, 0.0)
    found = balance(s, P, 3, 8.0)
    assert found.alpha * math.cos(8 * gamma) / found.alpha == pytest.approx(0.77, abs=0.01)


@pytest.mark.parametrize("ripple", [-0.01, 0.01])
def test_the_ripple_of_a_rotor_beside_home_is_found(ripple: float) -> None:
    found = balance(made(2.87, 0.003, ripple=ripple), P, 3, 8.0)
    assert found.ripple == pytest.approx(ripple, rel=1e-6)
    assert found.alpha == pytest.approx(2.87, rel=1e-9)
    assert found.gamma_0 == pytest.approx(0.003, rel=1e-9)


def test_where_the_rotor_rests() -> None:
    count = 1.5e-3
    seen = fit.resting(np.array([0.0, 0.4, 1.0, -1.1, 2.0, -3.0]) * count, count) / count
    np.testing.assert_allclose(seen, [0, 0, 1.5, -1.5, 2, -3])


def test_detent_is_found_and_taken_off() -> None:
    angle = np.arange(4) / 4 * 2 * math.pi / 16
    held = detent(angle, 0.01 + 0.2 * np.sin(16 * angle + 0.7), 16.0)
    assert held.amplitude == pytest.approx(0.2, rel=1e-9)
    s = made(2.87, 0.0)
    off = np.where(s.side > 0, 1.5e-3, -1.5e-3) * (s.side != 0)
    shifted = Steps(
        s.segments + (held.off_home(off) / np.cos(8 * s.gamma))[:, None], off, s.gamma, s.time, s.side, s.load, s.spread
    )
    assert abs(balance(shifted, P, 3, 8.0, NO_DETENT).alpha / 2.87 - 1) > 1e-3
    assert balance(shifted, P, 3, 8.0, held).alpha == pytest.approx(2.87, rel=1e-6)


def test_each_extra_term_finds_its_own() -> None:
    s = made(2.87, 0.0, noise=5e-4)
    assert abs(hypotheses.ratio_of_sides(balance(s, P, 3, 8.0), s).t) < 4
    longer = balance(s, {**P, "lever_left": 0.232}, 3, 8.0)
    assert hypotheses.ratio_of_sides(longer, s).value == pytest.approx(-0.0087, abs=1e-3)
    heavier = balance(s, {**P, "mass_1": 0.98}, 3, 8.0)
    assert hypotheses.of_load(heavier, s, 1).value == pytest.approx(0.02, abs=2e-3)
    assert hypotheses.shape_over_gamma(balance(s, P, 3, 8.0), s)[0] > 1e-4
    assert hypotheses.shape_over_gamma(balance(s, P, 3, 6.0), s)[0] < 1e-6


def test_arms_and_masses_within_their_certificates_are_no_departure_from_the_cosine() -> None:
    """Errors of 2e-4 stand out of step means that scatter by 1e-4 A: they are not a matter of gamma. By chance the probability
    is below 0.01 in one of a hundred."""
    chances = []
    for seed in range(200):
        s = made(2.87, 0.008, noise=5e-5, seed=seed, ripple=0.005)
        found = balance(s, {**P, "lever_left": 0.23005, "mass_1": 1.0001}, 3, 8.0)
        chance, largest = hypotheses.shape_over_gamma(found, s)
        chances.append(chance)
        assert largest < 1e-3
    assert sum(c < 0.01 for c in chances) <= 8
    assert min(chances) > 1e-6


@pytest.mark.parametrize("depth", [0.002, -0.02])
def test_a_torque_that_is_no_cosine_over_gamma_is_seen(depth: float) -> None:
    """A share of the third harmonic of gamma, as an iron core would make: found, and of its size."""
    s = made(2.87, 0.003, noise=5e-5)
    turn = 8 * (s.gamma - 0.003)
    bent = replace(s, segments=s.segments * (1 + depth * np.cos(3 * turn) * (s.side != 0))[:, None])
    chance, largest = hypotheses.shape_over_gamma(balance(bent, P, 3, 8.0), bent)
    assert chance < 1e-6
    assert largest == pytest.approx(abs(depth), rel=0.6)


def test_three_phase_angles_leave_no_shape_to_look_for() -> None:
    """alpha_tau, gamma_0 and the drift of the scale take one each."""
    s = made(2.87, 0.003, noise=5e-5)
    three = np.isin(s.gamma, np.unique(s.gamma)[1:4])
    part = Steps(*(getattr(s, n)[three] for n in ("segments", "angle", "gamma", "time", "side", "load", "spread")))
    assert hypotheses.shape_over_gamma(balance(part, P, 3, 8.0), part) == (1.0, 0.0)


def test_a_run_that_was_stopped_early_is_told() -> None:
    s = made(2.87, 0.0)
    for keep in (slice(0, 14), slice(0, 40)):
        part = Steps(*(getattr(s, n)[keep] for n in ("segments", "angle", "gamma", "time", "side", "load", "spread")))
        with pytest.raises(AnalysisError):
            balance(part, P, 3, 8.0)
