"""Errata of the thesis' chapter 4: each literal equation gives a wrong number where the corrected one is right.

Positions are polynomials and integrals are taken of them exactly, so that nothing but the equation decides.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from procedures.one_axis.bank import coefficient
from sim_backend.machines.amb1dof.params import ControlParams
from sim_backend.machines.amb1dof.plant import gains

DEGREE, AT = 7, 0.012
Y = Polynomial([3e-5, 0.02, -1.5, 80.0, 2e4])  # a motion of lower degree than K: the estimate is exact


def times(y: Polynomial, power: int) -> Polynomial:
    """(-t)^power y."""
    return Polynomial([0.0, -1.0]) ** power * y


def integral(y: Polynomial, order: int) -> Polynomial:
    """The iterated integral from 0; a negative order is a derivative."""
    return y.integ(order) if order > 0 else y.deriv(-order) if order < 0 else y


def residual(alpha: int, literal: bool) -> float:
    """Sum of (4.7) divided by s^alpha, over its largest term: sum_n C(K, n) K!/n! I^(alpha - n) (-t)^n y = 0.

    The terms of n > alpha are derivatives; `literal` has the printed order K - n - 1 in those that are integrals."""
    terms = []
    for n in range(DEGREE + 1):
        weight = math.comb(DEGREE, n) * math.factorial(DEGREE) / math.factorial(n)
        order = DEGREE - n - 1 if literal and n < alpha else alpha - n
        terms.append(weight * float(integral(times(Y, n), order)(AT)))
    return abs(sum(terms)) / max(map(abs, terms))


@pytest.mark.parametrize("alpha", [DEGREE - 1, DEGREE - 2, DEGREE - 3, DEGREE])
def test_order_of_the_iterated_integrals(alpha: int) -> None:
    """(4.7), (4.8), (4.9), (4.12): alpha - n. The printed K - n - 1 is right for alpha = K - 1 alone."""
    assert residual(alpha, literal=False) < 1e-9
    if alpha == DEGREE - 1:
        assert residual(alpha, literal=True) < 1e-9
    else:
        assert residual(alpha, literal=True) > 0.05


def estimate(signs: bool, way: float) -> float:
    """The derivative at AT by (4.11), 1/(-t)^K (-K (K - 1) (-t)^(K-1) y - sum_p a_1p I^(K-1-p) (-t)^p y); `signs`: a_1p
    with the factor of (4.15), `way` -1: the terms in y as they are printed, with +."""
    last = coefficient(DEGREE, DEGREE - 1) if signs else DEGREE * (DEGREE + 1.0)
    whole = sum(coefficient(DEGREE, p) * float(integral(times(Y, p), DEGREE - 1 - p)(AT)) for p in range(DEGREE - 1))
    return -(whole + way * last * float(times(Y, DEGREE - 1)(AT))) / (-AT) ** DEGREE


def test_signs_of_the_terms_in_y() -> None:
    """(4.10), (4.15) without (-1)^(n-p), and (4.11) with +: the derivative is off by more than itself."""
    true = float(Y.deriv()(AT))
    assert estimate(True, 1.0) == pytest.approx(true, rel=1e-9)
    assert coefficient(7, 6) == 42
    assert coefficient(6, 5) == 30
    assert abs(estimate(False, 1.0) / true - 1) > 1
    assert abs(estimate(True, -1.0) / true - 1) > 1


def test_the_second_equation_of_the_full_observer_is_of_its_velocity() -> None:
    """(4.21b): w^ for the derivative of v^. With it v^ has no equation and stays what it was, and y^ trails the motion."""
    _, g = gains(ControlParams())
    step, w, mass = 1e-4, 80 * math.pi, 0.4
    found = []
    for literal in (False, True):
        x, errors = np.zeros(5), []
        for k in range(20000):
            t = k * step
            y, force = 1e-4 * math.sin(w * t / 3), -1e-4 * (w / 3) ** 2 * mass * math.sin(w * t / 3)
            e = y - x[0]
            rate = np.array([x[1] + g[0] * e, (force + x[2] + x[3]) / mass + g[1] * e, g[2] * e, x[4] + g[3] * e,
                             g[4] * e - w * w * x[3]])  # fmt: skip
            if literal:
                rate[1] = 0.0  # it is that of w^, which no other equation has
            x = x + step * rate
            errors.append(x[1] - 1e-4 * w / 3 * math.cos(w * t / 3))
        found.append(float(np.sqrt(np.mean(np.square(errors[-7500:])))) / (1e-4 * w / 3 / math.sqrt(2)))
    assert found[0] < 0.05
    assert found[1] == pytest.approx(1.0, abs=1e-6)
