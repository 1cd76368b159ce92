"""The force-constant estimator on exact statics: right answers, what cancels, what does not, and the errata."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.uncertainty import Estimate, Influence
from procedures.force_constant import estimates as force_constant_estimates
from procedures.force_constant import fit
from procedures.force_constant.fit import BRANCH, CROSS, DIRECT, FORCE, MOMENT, TIME
from procedures.force_constant.plan import Plan
from procedures.force_constant.procedure import sequence
from tests.procedures.force_statics import BIAS, REACH, SPAN, Machine, changed, facts, parameters, ramps


def fitted(m: Machine, axis: str = "y", p: dict[str, float] | None = None, **options: float) -> fit.Fit:
    r, values = ramps(m, axis), p or parameters(m)
    return fit.fit(r, values, force_constant_estimates.constants(r, values, BIAS), BIAS, **options)


def alpha(f: fit.Fit) -> np.ndarray:
    return f.terms[:, :, DIRECT].mean(axis=1)


MACHINES = (Machine(), Machine(gamma_0=-0.008, alpha_2=-0.25), Machine(slopes=(60.0, 88.0)), Machine(shift=2e-8))


@pytest.mark.parametrize("m", MACHINES)
def test_both_rows_give_the_constant_and_its_ripple(m: Machine) -> None:
    """1e-4: a shift of 20 nm is corrected by the stiffness at no current."""
    f = fitted(m)
    true = np.array([m.ripple(a) for a in ramps(m).angles])
    np.testing.assert_allclose(f.terms[:, :, DIRECT], [true[:, 0]] * 2, rtol=1e-4)
    np.testing.assert_allclose(f.terms[:, :, CROSS], [true[:, 1]] * 2, atol=1e-3)
    assert alpha(f) == pytest.approx([m.alpha_d * np.cos(8 * m.gamma_0)] * 2, rel=1e-4)
    assert np.abs(f.residuals).max() < 1e-3


@pytest.mark.parametrize("m", [Machine(asymmetry=(0.02, -0.01)), Machine(gamma_0=-0.008, pull_x=-8.0)])
def test_the_horizontal_constant_follows_from_the_vertical_ones(m: Machine) -> None:
    """The journal stands elsewhere in the x axis, and a constant pull moves its currents: both are found from the data."""
    f = fitted(m, "x")
    assert alpha(f) == pytest.approx([m.alpha_d * np.cos(8 * m.gamma_0)] * 2, rel=2e-5)
    ignored = replace(m, asymmetry=(0.0, 0.0))
    if m.asymmetry != (0.0, 0.0):
        shares = np.array([1 + REACH / SPAN, -REACH / SPAN])
        off = alpha(fitted(m, "x", parameters(ignored))) / alpha(f) - 1
        assert off == pytest.approx([-(shares[0] * -0.01 + shares[1] * 0.02), -0.02], rel=0.05)


def test_hysteresis_and_drift_are_taken_out() -> None:
    m = Machine(play=5e-4, drift=1e-4)
    f = fitted(m)
    assert alpha(f) == pytest.approx([m.alpha_d * np.cos(8 * m.gamma_0)] * 2, rel=1e-6 + 2e-5)
    assert np.abs(f.terms[MOMENT, :, BRANCH]).min() > 0.01
    assert np.abs(f.terms[FORCE, :, BRANCH]).max() < 0.01  # the AMBs lag in opposite directions
    assert f.terms[:, :, TIME].mean() == pytest.approx(m.alpha_d * 0.5e-4, rel=0.05)


def test_turning_points_matter_little() -> None:
    """Half a milliampere of play on 75 N/A and a lever of two: 0.1 % at most."""
    m = Machine(play=5e-4)
    shift = alpha(fitted(m, turning=0.0)) / alpha(fitted(m)) - 1
    assert 0 < np.abs(shift).max() < 2e-3


def test_the_sequence_is_closed_mirrored_and_orthogonal() -> None:
    plan = Plan()
    levels = sequence(plan)
    i_y, i_x = (np.array([getattr(x, n) for x in levels]) for n in ("i_y", "i_x"))
    assert list(i_y) == list(i_y[::-1])
    assert {*i_y} == {*i_x} == set(plan.levels_A)
    assert float(i_y @ i_x) == pytest.approx(0, abs=1e-12)
    assert (i_y[0], i_x[0]) == (i_y[-1], i_x[-1]) == (-3.0, 0.0)
    moves = np.sign(np.diff(i_y))
    assert [x.branch_y for x in levels[1:]] == list(moves)
    assert levels[0].branch_y == -1


# The errata of T 6.6.2; each literal equation gives a wrong number where the corrected one is right.


def linear_changes() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Changes of both AMBs' control currents and of i_y for linear bearings, from (6.13)."""
    i_y = np.array([-3.0, -1.5, 0.0, 1.5, 3.0])
    force = 12.1 * i_y
    return np.diff(force * REACH / SPAN / 73.2), np.diff(-force * (1 + REACH / SPAN) / 74.4), np.diff(i_y)


def test_sign_of_the_force_row() -> None:
    """(6.14a) as printed, 0 = K_i di_i + K_o di_o - alpha_d di_y, gives minus the constant; with plus it is right."""
    d_i, d_o, d_y = linear_changes()
    force = 73.2 * d_i + 74.4 * d_o
    literal = (force @ d_y) / (d_y @ d_y)
    assert literal == pytest.approx(-12.1)
    assert -literal == pytest.approx(12.1)


def stacked(k_i: float, k_o: float) -> tuple[float, float, float]:
    """Force row, moment row (about the centre of mass, 6.14b) and both stacked without weights, with constants assumed."""
    d_i, d_o, d_y = linear_changes()
    l_ia, l_oa, l_m = 0.115, 0.010, 0.122
    force, moment = -(k_i * d_i + k_o * d_o), l_ia * k_i * d_i - l_oa * k_o * d_o
    both = (force @ d_y + l_m * moment @ d_y) / ((1 + l_m**2) * d_y @ d_y)
    return float(force @ d_y / (d_y @ d_y)), float(moment @ d_y / (d_y @ d_y)) / l_m, float(both)


def test_stacking_newtons_and_newton_metres_is_a_hidden_weighting() -> None:
    """Independent errors of 4.4 % (K_i high, K_o low): the force row is 12 % low, the moment row 3 % high, and the stack
    follows the force row, because a row in N m counts l_m^2 = 1.5 % of one in N."""
    assert stacked(73.2, 74.4) == pytest.approx((12.1, 12.1, 12.1))
    force, moment, both = (x / 12.1 - 1 for x in stacked(1.044 * 73.2, 0.956 * 74.4))
    assert force == pytest.approx(-0.12, abs=0.005)
    assert moment == pytest.approx(0.03, abs=0.005)
    assert both == pytest.approx(force, abs=0.003)


def test_best_weights_undo_it() -> None:
    """By their covariance the rows get the weights that leave the least of those errors."""
    u_i, u_o = 0.044 * 0.896, 0.044 * 1.896  # in the force row, shares of alpha
    v = np.array([[u_i**2 + u_o**2, -(u_i**2) * SPAN / REACH], [-(u_i**2) * SPAN / REACH, (u_i * SPAN / REACH) ** 2]])
    w = fit.best_weights(v)
    assert w.sum() == pytest.approx(1)
    tried = [float(np.array([x, 1 - x]) @ v @ np.array([x, 1 - x])) for x in np.linspace(-1, 2, 301)]
    assert float(w @ v @ w) <= min(tried) + 1e-12
    assert float(w @ v @ w) < min(v[0, 0], v[1, 1])


def estimates(m: Machine, u_gain: float) -> tuple[dict[str, Estimate], dict[str, Estimate]]:
    """Facts whose only uncertainty is that of the four coil sensors' gains, and the same gains as inputs of this run.

    A calibration by weights that reads its currents g times too small has K g times too small, to first order.
    """
    gains = {f"y{b}{c}": Influence(f"sensors/i_y{b}_{c}/gain", "gain", u_gain, "1", "B", "rectangular")
             for b in "io" for c in "pn"}  # fmt: skip
    known = {k: Estimate.exact(v) for k, v in facts(m).items()}
    for b in "io":
        for k in range(9):
            mean, half = (known[f"{name}_{b}@{k}"].value for name in ("K", "K2"))
            a, c = mean / (4 * BIAS) + half / 2, mean / (4 * BIAS) - half / 2  # F = a ip^2 - c in^2
            p, n = (Estimate.of(1.0, gains[f"y{b}{coil}"]) for coil in "pn")
            known[f"K_{b}@{k}"] = (p * p * a + n * n * c) * (2 * BIAS)
            known[f"K2_{b}@{k}"] = p * p * a - n * n * c
    inputs = {k: Estimate.exact(v) for k, v in parameters(m).items()} | known
    return known, inputs | {f"gain_{short}": Estimate.of(1.0, gain) for short, gain in gains.items()}


def test_what_the_calibration_shares_cancels() -> None:
    """Gains of 0.3 %: a calibration that knows them cancels them, one that does not leaves some tenths of a per cent."""
    m = Machine()
    known, inputs = estimates(m, 0.003 / np.sqrt(3))
    shared = force_constant_estimates.axis_result(ramps(m), inputs, BIAS)
    alone = force_constant_estimates.axis_result(
        ramps(m), inputs | force_constant_estimates.taken_alone(known, 9), BIAS
    )
    force, moment = (e.u / e.value for e in shared.row_means)
    assert max(force, moment) < 1e-5
    force, moment = (e.u / e.value for e in alone.row_means)
    assert 4e-3 < force < 1e-2
    assert 2e-3 < moment < 5e-3
    assert alone.mean.u < min(e.u for e in alone.row_means)


def test_rows_that_contradict_each_other_name_the_suspect() -> None:
    m = Machine()
    _, inputs = estimates(m, 0.003 / np.sqrt(3))
    noise = np.random.default_rng(7).normal(0, 1e-4, ramps(m).coils.shape)
    r = replace(ramps(m), coils=ramps(m).coils + noise)

    def told(values: dict[str, float]) -> tuple[float, str]:
        given = {k: Estimate.exact(values[k]) if "@" in k else e for k, e in inputs.items()}
        result = force_constant_estimates.axis_result(r, given, BIAS)
        return force_constant_estimates.misfit(result)[0], force_constant_estimates.suspect(r, given, BIAS, result)

    exact = parameters(m)
    chi2, text = told(exact)
    assert chi2 < 100
    assert text == ""
    assert "opposite sign of K_i" in told(changed(exact, "K_i@", -1.0))[1]
    assert "opposite sign of K_o" in told(changed(exact, "K_o@", -1.0))[1]
    moved = {
        k: exact[f"{k.split('@')[0]}@{(int(k.split('@')[1]) + 2) % 9}"] if "@" in k else v for k, v in exact.items()
    }
    assert "further on" in told(moved)[1]


@pytest.mark.parametrize(("angles", "same"), [(8, True), (9, False), (16, True), (12, False), (4, True)])
def test_which_angles_share_one_electrical_phase(angles: int, same: bool) -> None:
    assert fit.aliased(angles, 8) is same
    phases = np.cos(16 * 2 * np.pi * np.arange(angles) / angles + 0.3)
    assert bool(abs(phases.mean()) > 1e-9) is same


def test_rows_use_the_constants_they_are_given() -> None:
    """Force and moment rows scale as their levers say."""
    m = Machine()
    base = alpha(fitted(m))
    more = alpha(fitted(m, p=changed(changed(parameters(m), "K_i@", 1.01), "K2_i@", 1.01)))
    np.testing.assert_allclose(more / base - 1, [-0.01 * REACH / SPAN, 0.01], rtol=1e-3)
    assert (FORCE, MOMENT) == (0, 1)
