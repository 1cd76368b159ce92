"""Errata of the thesis' load balancing (6.7.3): each literal equation gives a wrong number where the corrected one is right."""

from __future__ import annotations

import math

import numpy as np
import pytest

from procedures.load_balancing import fit
from procedures.load_balancing.fit import Law

MASS, POLE = 6.34, 1200.0
P = {f"gain_m{k}": 1.0 for k in range(1, 5)} | {f"offset_m{k}": 0.0 for k in range(1, 5)}
P |= {"alpha_d": 12.1, "chi": 1.0, "ratio": 12.1 / 14.3, "gamma_0": 0.0, "pole_pairs": 8.0}
LOAD = 22.0 - 48.55j + 34.43 * np.exp(1j * np.linspace(0, 2 * math.pi, 2000, endpoint=False))


def turned(t: float, step: float = 1e-4) -> tuple[complex, complex, complex, float, float, complex]:
    """z' = z e^(-j phi) with its rates, those of phi, and the force m z'' in the turned frame, by differences."""

    def z(s: float) -> complex:
        return complex(1e-4 * np.exp(1.6j * s) + 2e-5 * s * s)

    def phi(s: float) -> float:
        return 0.8 * math.sin(3.0 * s)

    own = [z(t + k * step) * np.exp(-1j * phi(t + k * step)) for k in (-1, 0, 1)]
    fixed, angle = [z(t + k * step) for k in (-1, 0, 1)], [phi(t + k * step) for k in (-1, 0, 1)]
    force = MASS * (fixed[2] - 2 * fixed[1] + fixed[0]) / step**2 * np.exp(-1j * angle[1])
    rate, bend = (angle[2] - angle[0]) / (2 * step), (angle[2] - 2 * angle[1] + angle[0]) / step**2
    return (own[1], (own[2] - own[0]) / (2 * step), (own[2] - 2 * own[1] + own[0]) / step**2, rate, bend, force)


@pytest.mark.parametrize("t", [0.1, 0.4, 0.9])
def test_terms_of_the_turned_frame_go_with_the_mass(t: float) -> None:
    """(6.28), (6.29): m r'' = F' - m (2 j phi' r' + j phi'' r - phi'^2 r); printed without m, and over m in (6.30b,e)."""
    z, velocity, acceleration, rate, bend, force = turned(t)
    terms = 2j * rate * velocity + 1j * bend * z - rate**2 * z
    right, printed = (abs(MASS * acceleration - (force - m * terms)) for m in (MASS, 1.0))
    assert right < 1e-3 * abs(MASS * terms)
    assert printed == pytest.approx((1 - 1 / MASS) * abs(MASS * terms), rel=1e-2)


def test_a_constant_load_turns_in_the_turned_frame() -> None:
    """(6.30c,f): F' of a constant load changes by -j phi' F'; the printed rates have the observer's correction alone."""
    load, rate, step = 22.0 - 48.55j, 1.0, 1e-5
    own = [load * np.exp(-1j * rate * k * step) for k in (0, 1)]
    change = (own[1] - own[0]) / step
    assert change.real == pytest.approx(rate * own[0].imag, rel=1e-4)  # + phi' F'_cy in (c)
    assert change.imag == pytest.approx(-rate * own[0].real, abs=1e-2)  # - phi' F'_cx in (f)
    # what the printed observer takes for no change, N/s
    assert abs(change) == pytest.approx(53.3, abs=0.1)


def observer(l1: float, l2: float, l3: float) -> np.ndarray:
    """Error of position, velocity and load of one axis, T (6.31) with phi at rest."""
    return np.array([[-l1, 1.0, 0.0], [-l2, 0.0, 1 / MASS], [-l3, 0.0, 0.0]])


def test_no_gains_make_the_symmetric_part_negative() -> None:
    """(6.31) and the proof under it: the entry (2,2) of A + A^T is 0 and the one beside it 1/m, so that it has a positive
    eigenvalue for every choice. The observer is stable all the same, with the gains that place its poles."""
    draws = 10 ** np.random.default_rng(6).uniform(-3, 9, (300, 3))
    for gains in (*draws, (3 * POLE, 3 * POLE**2, POLE**3 * MASS)):
        a = observer(*gains)
        assert np.linalg.eigvalsh(a + a.T).max() > 0
    poles = np.linalg.eigvals(observer(3 * POLE, 3 * POLE**2, POLE**3 * MASS))
    assert poles == pytest.approx(np.full(3, -POLE), rel=1e-3)


def goal(delta: float) -> float:
    """(6.36): gamma by the load's direction, degrees."""
    turn = delta + math.pi / 4 if delta < 0 else delta - math.pi / 4
    return math.degrees(math.atan2(12.1 * math.sin(turn), 14.3 * math.cos(turn)) / 8)


def test_the_direction_comes_before_the_angle_that_answers_it() -> None:
    """ "(6.36) followed by (6.37)": the goal needs the delta that (6.37) gives. In the printed order it answers the one of the
    sample before; at the first sample there is none, and gamma begins on the other side."""
    delta = math.atan(-48.55 / 22.0)
    assert goal(delta) == pytest.approx(-2.208, abs=0.001)
    assert goal(0.0) == pytest.approx(-5.03, abs=0.01)


def test_in_two_quadrants_the_angle_would_jump_where_the_load_is_largest() -> None:
    """(6.35) restricted to two quadrants: from the one bound of 5.03 degrees to the other, 0.4 s at 25 deg/s, as the load
    passes the vertical; there it is 83 N, and i_y as without balancing while gamma passes zero."""
    across = np.flatnonzero(np.diff(np.sign(LOAD.real)))
    delta = np.arctan(LOAD.imag / LOAD.real)
    jump = [goal(float(delta[k + 1])) - goal(float(delta[k])) for k in across]
    assert np.abs(jump) == pytest.approx(np.full(2, 10.06), abs=0.1)
    assert abs(jump[0]) / 25 == pytest.approx(0.40, abs=0.01)
    assert np.abs(LOAD[across]).max() == pytest.approx(75.0, abs=2.0)
    assert np.abs(LOAD).max() < 90


def test_gamma_goes_beyond_five_degrees_without_an_overshoot() -> None:
    """6.7.3: "because of the slew limiter". One does not overshoot; the line of the load leaves two quadrants: -7.3 to 2.1."""
    free, slewed = (fit.balanced(LOAD, Law(0.25, slew, 1.0, -1), P).gamma for slew in (1e4, math.radians(25)))
    assert np.degrees([free.min(), free.max()]) == pytest.approx([-7.3, 2.1], abs=0.3)
    assert free.min() - 1e-9 <= slewed.min()
    assert slewed.max() <= free.max() + 1e-9


def test_the_plane_that_is_held_decides_the_stiffness() -> None:
    """alpha_x' (6.8) is 322.3 N/mm where the inboard sensor's plane is held; a loop that holds the AMB's has 344.3 N/mm."""
    from procedures.load_balancing.inputs import of_amb_plane

    assert 322.3 * of_amb_plane(0.161, 0.052, 0.115, 0.122) == pytest.approx(344.3, abs=0.1)
