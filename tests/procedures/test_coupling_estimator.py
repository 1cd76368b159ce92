"""The coupling estimator on exact statics: right answers, T's own way, and the erratum of successive differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tsbs_statics import Shaft, parameters, segments, sweep_data

from bench.errors import AnalysisError
from procedures.force_coupling import fit as force_coupling_fit
from procedures.servomotor.segments import radial_currents

DEGREES = np.arange(-2.5, 3.6, 0.5)


@pytest.mark.parametrize("gamma_0", [0.0, 0.4, -0.5])
@pytest.mark.parametrize("winding", [1.0, 1.02, 0.98])
def test_exact_currents_give_exact_terms(gamma_0: float, winding: float) -> None:
    shaft = Shaft(gamma_0=np.radians(gamma_0), winding=winding)
    fit = force_coupling_fit.fit_sweep(sweep_data(shaft, DEGREES), parameters(shaft))
    assert fit.term("r") == pytest.approx(12.1 / 14.3, rel=1e-8)
    assert fit.term("a") == pytest.approx(winding, rel=1e-8)
    assert fit.term("gamma_0") == pytest.approx(shaft.gamma_0, abs=1e-9)
    assert np.abs(fit.fit.residuals).max() < 1e-9


@pytest.mark.parametrize("factor", [0.98, 1.0, 1.01])
def test_a_gamma_that_is_not_what_was_told_is_found(factor: float) -> None:
    """One step of Gauss and Newton: what is left goes with the square of the factor's distance from one."""
    shaft = Shaft(gamma_0=np.radians(0.4))
    turned = sweep_data(shaft, DEGREES * factor)
    fit = force_coupling_fit.fit_sweep(replace(turned, gamma=turned.gamma / factor), parameters(shaft))
    assert fit.turn[0] == pytest.approx(factor, abs=max(3 * (factor - 1) ** 2, 1e-7))


def test_an_error_of_all_gains_does_not_reach_the_ratio() -> None:
    """A common gain scales the forces, one of the x axis the winding's constant; r stays to first order."""
    shaft = Shaft(gamma_0=np.radians(0.3))
    p = parameters(shaft)
    for names, gain in ((("m1", "m3"), 1.003), (("m2", "m4"), 1.003), (("m1", "m2", "m3", "m4"), 1.01)):
        fit = force_coupling_fit.fit_sweep(sweep_data(shaft, DEGREES), p | {f"gain_{n}": gain for n in names})
        assert fit.term("r") == pytest.approx(12.1 / 14.3, rel=1e-6)


def test_a_shaft_off_the_sensors_zero_is_corrected() -> None:
    shaft = Shaft()
    data = sweep_data(shaft, DEGREES)
    rng = np.random.default_rng(3)
    off = rng.normal(0, 1e-7, len(data.gamma))
    i = np.array([shaft.by_motor(0.0, o, g) for o, g in zip(off, data.gamma, strict=True)])
    moved = replace(data, segments=segments(i[:, 0], i[:, 1]), y=np.array([0 * off, off]))
    fit = force_coupling_fit.fit_sweep(moved, parameters(shaft))
    assert fit.term("r") == pytest.approx(12.1 / 14.3, rel=1e-8)


def test_the_scatter_stated_is_the_scatter_found() -> None:
    """Noise in the currents: the covariance of the fit against 300 repetitions."""
    shaft = Shaft(gamma_0=np.radians(0.3), winding=1.01)
    data, p, rng = sweep_data(shaft, DEGREES), parameters(shaft), np.random.default_rng(7)
    fits = [
        force_coupling_fit.fit_sweep(
            replace(data, segments=data.segments + rng.normal(0, 1e-3, data.segments.shape)), p
        )
        for _ in range(300)
    ]
    for name, true in (("w", 14.3 / 12.1), ("a", 1.01), ("gamma_0", shaft.gamma_0)):
        index = force_coupling_fit.TERMS.index(name)
        found = np.array([f.fit.terms[index] for f in fits])
        stated = np.mean([f.fit.u[index] for f in fits])
        assert found.std() == pytest.approx(stated, rel=0.15)
        assert abs(found.mean() - true) < 4 * found.std() / np.sqrt(300)


def test_as_printed_is_right_only_with_the_encoder_at_zero() -> None:
    for gamma_0, good in ((0.0, True), (np.radians(0.5), False)):
        data = sweep_data(Shaft(gamma_0=gamma_0), DEGREES)
        r = force_coupling_fit.as_printed(data.gamma, *radial_currents(data.segments, parameters(Shaft())), 8.0)
        assert (abs(r / (12.1 / 14.3) - 1) < 1e-6) is good


def test_erratum_successive_differences_multiply_an_integrator_that_has_not_settled() -> None:
    """The hand-over leaves 50 mA that die away over three steps: T's differences from step to step suffer twice as much
    as deviations from the mean."""
    shaft = Shaft()
    data = sweep_data(shaft, DEGREES)
    i_x, i_y = (x[: len(DEGREES)] for x in radial_currents(data.segments, parameters(shaft)))
    gamma = data.gamma[: len(DEGREES)]
    late = i_y + 0.05 * np.exp(-np.arange(len(DEGREES)) / 3)
    by_mean = force_coupling_fit.as_printed(gamma, i_x, late, 8.0) / (12.1 / 14.3) - 1
    by_step = force_coupling_fit.as_printed(gamma, i_x, late, 8.0, successive=True) / (12.1 / 14.3) - 1
    assert 0.003 < by_mean < 0.6 * by_step


def test_a_wrong_sense_of_gamma_comes_out_as_a_negative_ratio() -> None:
    shaft = Shaft(alpha_c=-14.3)
    assert force_coupling_fit.fit_sweep(sweep_data(shaft, DEGREES), parameters(shaft)).term("r") == pytest.approx(
        -12.1 / 14.3
    )


def test_ripple_is_told_from_the_constants_by_the_two_edges() -> None:
    """Off home by half a count (0.77 mrad, P theta = 12 mrad) the ripple turns the force; on the way up one way, on the way
    down the other. What is left is the ripple at home, which is a part of the constants."""
    fit = force_coupling_fit.fit_sweep(
        sweep_data(Shaft(gamma_0=np.radians(0.3)), DEGREES, (0.3, -0.2)), parameters(Shaft())
    )
    assert fit.term("r") == pytest.approx((12.1 - 0.3) / (14.3 - 0.2), rel=1e-7)
    assert fit.term("gamma_0") == pytest.approx(np.radians(0.3), abs=1e-8)
    assert fit.term("rho_2") == pytest.approx(0.3 / 11.8, rel=1e-4)
    assert fit.term("rho_3") == pytest.approx(-0.2 / 14.1, rel=1e-4)


def test_a_rotor_that_stays_at_one_edge_does_not_tell_the_ripple() -> None:
    data = sweep_data(Shaft(), DEGREES)
    with pytest.raises(AnalysisError, match="determine"):
        force_coupling_fit.fit_sweep(replace(data, theta=0 * data.theta), parameters(Shaft()))
