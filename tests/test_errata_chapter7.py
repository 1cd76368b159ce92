"""Errata of the thesis' chapter 7: each literal equation gives a wrong number where the corrected one is right.

Forces are those of the four segments by T (6.5), of any q and d: segment 1 is up, 2 to the left, 3 down, 4 to the right.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

Array = npt.NDArray[np.float64]
ALPHA_D, ALPHA_C = 12.1, 14.3  # N/A, T Table 6.2
LIMIT = 10.0  # A, I_s
ROOT = math.sqrt(2)


def force(q: Array, d: Array) -> Array:
    """(x, y) N of the segments' currents, (4,) each: T (6.5) with i cos M gamma = q, i sin M gamma = d."""
    return np.array([ALPHA_D * (q[3] - q[1]) / 2 - ALPHA_C * (d[0] - d[2]) / 2,
                     ALPHA_D * (q[0] - q[2]) / 2 + ALPHA_C * (d[3] - d[1]) / 2])  # fmt: skip


def shared(i_x: float, i_y: float, i_theta: float, literal: bool = False) -> tuple[Array, Array]:
    """T (7.13): segments 1, 2 carry q1, d1 and 3, 4 carry q2, d2. Printed c and d have the signs of i_y exchanged."""
    sign = -1.0 if literal else 1.0
    q1, q2 = i_theta + sign * i_y, i_theta - sign * i_y
    return np.array([q1, q1, q2, q2]), np.array([-i_x, -i_x, i_x, i_x])


def own(x: float, y: float, literal: bool = False) -> tuple[float, float]:
    """T (7.6): into axes turned by 45 degrees. Printed (7.6b) is (x - y)/sqrt 2."""
    return (x + y) / ROOT, (x - y if literal else y - x) / ROOT


def test_the_turned_axes_are_a_right_handed_frame() -> None:
    """(7.6b): printed, the matrix has the determinant -1, a mirror and no turn; 1 N upwards then reads as -0.71 along y6."""
    for literal, expected in ((False, 1.0), (True, -1.0)):
        matrix = np.array([own(1.0, 0.0, literal), own(0.0, 1.0, literal)]).T
        assert np.linalg.det(matrix) == pytest.approx(expected)
    assert own(*force(*shared(0.0, 1.0, 0.0))) == pytest.approx((0.0, ROOT * ALPHA_D))  # alpha_t, as T has it
    assert own(*force(*shared(0.0, 1.0, 0.0)), literal=True)[1] == pytest.approx(-ROOT * ALPHA_D)


def test_printed_shares_contradict_the_inverse() -> None:
    """(7.12) has i_y = (q1 - q2)/2; with printed (7.13c,d) it comes out with the other sign, and so does the force."""
    for literal, sign in ((False, 1.0), (True, -1.0)):
        q, d = shared(0.7, 1.3, 0.4, literal)
        assert ((q[0] + q[2]) / 2, (d[2] - d[0]) / 2) == pytest.approx((0.4, 0.7))
        assert (q[0] - q[2]) / 2 == pytest.approx(sign * 1.3)
        assert own(*force(q, d)) == pytest.approx((ROOT * ALPHA_C * 0.7, sign * ROOT * ALPHA_D * 1.3))


@pytest.mark.parametrize(
    ("b_literal", "shares_literal", "feedback", "held"),
    [
        (False, False, 1.0, True),
        (True, False, 1.0, False),  # (7.6b) alone
        (False, True, 1.0, False),  # (7.13c,d) alone
        (False, False, -1.0, False),  # (7.14): a minus in front of all three controllers
        (True, True, 1.0, True),  # the two cancel
    ],
)
def test_which_signs_hold_the_shaft(b_literal: bool, shares_literal: bool, feedback: float, held: bool) -> None:
    """6.31 kg on 322 N/mm of negative stiffness, PD (1e5 A/m, 300 A s/m on alpha_d) along each axis of its own frame:
    the matrix of the motion has poles to the right unless every sign is right, or two are wrong."""
    mass, stiffness, k_p, k_d = 6.31, 322.3e3, 1e5, 300.0
    gain = {"x": ALPHA_D / (ROOT * ALPHA_C), "y": 1 / ROOT}

    def acting(of: float, at: Array) -> Array:
        x, y = own(*at, b_literal)
        return feedback * of * force(*shared(-gain["x"] * x, -gain["y"] * y, 0.0, shares_literal))

    by_place = np.column_stack([acting(k_p, e) for e in np.eye(2)]) + stiffness * np.eye(2)
    by_speed = np.column_stack([acting(k_d, e) for e in np.eye(2)])
    motion = np.block([[np.zeros((2, 2)), np.eye(2)], [by_place / mass, by_speed / mass]])
    assert (np.linalg.eigvals(motion).real.max() < 0) == held


def bound(i_x: float, i_y: float, literal: bool) -> float:
    """T (7.18): what force leaves to the torque current, A."""
    if literal:
        return abs(abs(i_y) - math.sqrt(LIMIT**2 - i_x**2))
    scale = LIMIT / max(LIMIT, math.hypot(i_x, i_y))
    x, y = scale * i_x, scale * i_y
    return max(0.0, math.sqrt(max(0.0, LIMIT**2 - x**2)) - abs(y))


def test_the_printed_bound_grants_torque_beyond_the_amplifiers() -> None:
    """i_x 6, i_y 9 A: force alone is 10.8 A. Printed 1 A is left, and segment 1 would have to carry 11.7 A."""
    assert bound(6.0, 9.0, literal=False) == pytest.approx(0.0, abs=1e-12)
    assert bound(6.0, 9.0, literal=True) == pytest.approx(1.0)
    q, d = shared(6.0, 9.0, bound(6.0, 9.0, literal=True))
    assert np.hypot(q, d).max() == pytest.approx(math.hypot(10.0, 6.0))
    for i_x, i_y in ((6.0, 4.0), (-3.0, 7.0), (0.0, 0.0)):
        assert bound(i_x, i_y, literal=True) == pytest.approx(
            bound(i_x, i_y, literal=False)
        )  # inside the circle both hold
        q, d = shared(i_x, i_y, bound(i_x, i_y, literal=False))
        assert np.hypot(q, d).max() == pytest.approx(LIMIT)
