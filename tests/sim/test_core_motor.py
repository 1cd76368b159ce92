"""Forces and torque of the motor by hand: T (6.1) integrated, the terms of T (5.25), wiring, and what angles average out."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy import integrate
from sim_plants import floating

from sim_backend.machines.tsbs.params import PlantParams
from sim_backend.machines.tsbs.plant import derivative

X, Y, THETA = 6, 7, 11
M, P = 8, 16


def wrench(
    p: PlantParams, segment: Sequence[float], *, x: float = 0.0, y: float = 0.0, theta: float = 0.0, gamma: float = 0.0
) -> tuple[float, float, float]:
    """F_x, F_y in N and torque in N m on a shaft at rest that is displaced in parallel."""
    s = np.zeros(14)
    s[0], s[1], s[5] = x, y, theta
    out = derivative(p, s, np.zeros(10), np.array(segment), gamma=gamma)
    return float(out[X] * p.mass), float(out[Y] * p.mass), float(out[THETA] * p.polar_inertia)


def lorentz(segment: Sequence[float], theta: float, gamma: float) -> tuple[float, float]:
    """F_x and F_y by quadrature of T (6.1a, b) for a centred rotor, in units of L N0' m1 / m2.

    B = m1/m2 sin M(theta - Phi) (T 5.8), I_k = N0' i_k sin M(Phi - theta - gamma), segment k about (k - 1) pi/2.
    """
    total = np.zeros(2)
    for k, i in enumerate(segment):
        middle = k * math.pi / 2

        def product(phi: float, i: float = i) -> float:
            return math.sin(M * (theta - phi)) * i * math.sin(M * (phi - theta - gamma))

        ends = (middle - math.pi / 4, middle + math.pi / 4)
        total[0] += integrate.quad(lambda phi: product(phi) * math.sin(phi), *ends, epsabs=1e-13, limit=200)[0]
        total[1] -= integrate.quad(lambda phi: product(phi) * math.cos(phi), *ends, epsabs=1e-13, limit=200)[0]
    return float(total[0]), float(total[1])


@pytest.mark.parametrize("gamma", [-0.04, 0.0, 0.06])
@pytest.mark.parametrize("theta", [0.0, 0.05, 0.3, 1.9])
def test_the_ripple_goes_with_p_theta_plus_m_gamma(theta: float, gamma: float) -> None:
    """The core's terms are those of T (6.1): constant with cos(M gamma), ripple with P theta + M gamma, factors of (5.19)."""
    unit = math.sqrt(2)
    ripple = {"alpha_2": -unit / (P**2 - 1), "alpha_3": P * unit / (P**2 - 1)}
    p = floating(alpha_d=unit, alpha_c=0.0, alpha_4=0.0, alpha_6=0.0, **ripple)
    for segment in ((1.0, 0.0, -1.0, 0.0), (0.0, -1.0, 0.0, 1.0), (0.4, -0.3, -0.4, 0.3)):
        found = wrench(p, segment, theta=theta, gamma=gamma)
        assert found[:2] == pytest.approx(lorentz(segment, theta, gamma), abs=1e-10)


def test_each_term_of_the_general_model() -> None:
    """T (5.25) at P theta = 0.9 for 1, 2 and 3 A (x, y, torque) at (20, -30) um, term by term by hand."""
    ix, iy, turn, x, y, theta = 1.0, 2.0, 3.0, 2e-5, -3e-5, 0.9 / P
    segment = (turn + iy, turn - ix, turn - iy, turn + ix)
    none = {"alpha_d": 0.0, "alpha_c": 0.0, "alpha_tau": 0.0, "alpha_4": 0.0, "alpha_6": 0.0, "beta_2": 0.0}
    c, q = math.cos(0.9), math.sin(0.9)
    expected: dict[str, tuple[float, float, float]] = {
        "alpha_d": (ix, iy, 0),
        "alpha_2": (-c * ix, -c * iy, 0),
        "alpha_3": (-q * iy, q * ix, 0),
        "alpha_4": (-y * turn, x * turn, 0),
        "alpha_x": (x, y, 0),
        "alpha_6": (iy * turn, -ix * turn, 0),
        "alpha_tau": (0, 0, turn),
        "beta_2": (0, 0, x * iy - y * ix),
        "beta_4": (0, 0, math.cos(2.7) * turn),
    }
    for name, by_hand in expected.items():
        found = wrench(floating(**{**none, name: 1.0}), segment, x=x, y=y, theta=theta)
        np.testing.assert_allclose(found, by_hand, rtol=1e-12, atol=1e-14, err_msg=name)


def test_torque_over_the_phase_angle() -> None:
    """T (6.5c) with the third harmonic: at the home angle both go with cos M gamma, about the zero of the commutation."""
    p = floating(beta_4=0.02, gamma_zero=0.005)
    for gamma in np.radians([-5.03, 0.0, 5.03]):
        expected = (p.alpha_tau + 0.02) * math.cos(M * (gamma - 0.005)) * 2.0
        assert wrench(p, (2.0,) * 4, gamma=gamma)[2] == pytest.approx(expected, rel=1e-12)
    assert math.cos(M * math.radians(5.03)) == pytest.approx(1 - 0.23, abs=0.01)  # 23 % less, T 6.6.4


def test_displacement_counts_from_the_magnetic_centre() -> None:
    p = floating(alpha_4=880.0, motor_x=1e-5, motor_y=2e-5, alpha_6=0.0)
    assert wrench(p, (3.0,) * 4)[:2] == pytest.approx((-880 * 2e-5 * 3, 880 * 1e-5 * 3), rel=1e-12)


def test_exchanged_segments_make_a_lift_push_too() -> None:
    """The wires of segments 1 and 2 exchanged: half of what was to lift flows in segment 2, which pushes along -x."""
    right, wrong = (wrench(floating(exchange_segments=e, alpha_6=0.0), (1.0, 0.0, -1.0, 0.0)) for e in (0.0, 1.0))
    assert right[:2] == pytest.approx((0, 12.1), abs=1e-12)
    assert wrong[:2] == pytest.approx((-12.1 / 2, 12.1 / 2), rel=1e-12)


@pytest.mark.parametrize(("angles", "left"), [(9, 0.0), (8, 1.0)])
def test_nine_angles_average_the_ripple_out_and_eight_do_not(angles: int, left: float) -> None:
    """16 n/8 and 48 n/8 are whole: at eight equal steps the ripple has one phase. 16 mod 9 = 7, 48 mod 9 = 3."""
    p = floating(alpha_2=0.3, alpha_3=0.2, beta_4=0.02)
    turn = 2 * math.pi * np.arange(angles) / angles
    lift = np.mean([wrench(p, (1.0, 0.0, -1.0, 0.0), theta=t) for t in turn], axis=0)
    torque = np.mean([wrench(p, (1.0,) * 4, theta=t)[2] for t in turn])
    assert lift[1] == pytest.approx(p.alpha_d - left * 0.3, abs=1e-10)
    assert lift[0] == pytest.approx(0.0, abs=1e-10)
    assert torque == pytest.approx(p.alpha_tau + left * 0.02, abs=1e-10)
