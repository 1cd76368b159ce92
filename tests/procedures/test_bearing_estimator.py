"""Force constant, offset and gap from positions: exact on exact data, with the signs of T (2.6) corrected, and the errata."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.uncertainty import Estimate, Influence
from procedures.estimators import bearing
from procedures.estimators.bearing import AXES, COILS, Positions
from procedures.estimators.bearing_estimates import together

GAP, BETA, BIAS = 5.25e-4, 6.95e-7, 1.0
G = 9.81
PLANE = {
    "mass": 0.98,
    "gravity": G,
    "axes": math.pi / 4,
    "l_is": 0.078,
    "l_os": 0.1,
    "l_oa": 0.081,
    "amb_span": 0.178,
    "l_c": 0.155,
    "coupling": 1200.0,
    "relaxed_y": 0.0,
    "relaxed_z": 0.0,
    "gap": GAP,
}
SOUND = (PLANE | {f"{k}_{a}": v for a in AXES for k, v in (("gain", 1.0), ("zero", 0.0), ("runout", 0.0))}
         | {f"{k}_{c}": v for c in COILS for k, v in (("gain", 1.0), ("offset", 0.0))})  # fmt: skip
PLACES = np.array(
    [(y, z) for y in np.linspace(-80e-6, 80e-6, 9) for z in np.linspace(-80e-6, 80e-6, 9) if math.hypot(y, z) < 82e-6]
).T


def currents(force: np.ndarray, xi: np.ndarray, beta: float = BETA) -> tuple[np.ndarray, np.ndarray]:
    """Coil currents of a constant sum that give the force, by bisection: nothing of the estimators is in it."""
    low, high = np.full_like(force, -BIAS), np.full_like(force, BIAS)
    for _ in range(80):
        d = (low + high) / 2
        less = beta * (((BIAS + d) / (GAP - xi)) ** 2 - ((BIAS - d) / (GAP + xi)) ** 2) < force
        low, high = np.where(less, d, low), np.where(less, high, d)
    return BIAS + d, BIAS - d


def positions(offsets: tuple[float, ...], gravity: float = -G) -> Positions:
    """The shaft without tilt on a grid, carried by magnets and a spring: forces from a 2 x 2 balance of force and moment."""
    y, z = PLACES
    weight, spring = 0.98 * gravity / math.sqrt(2), 1200.0
    read, p, n = np.array([y, z, y, z]), np.zeros((4, y.size)), np.zeros((4, y.size))
    for first, at in ((0, y), (1, z)):
        load = -weight + spring * at  # F_i + F_o
        moment = -0.155 * spring * at  # -l_ia F_i + l_oa F_o, the spring pulls at -l_c
        both = np.linalg.solve([[1, 1], [-0.097, 0.081]], np.array([load, moment]))
        for b in (0, 1):
            k = first + 2 * b
            p[k], n[k] = currents(both[b], offsets[k] + at)
    return Positions(read, p, n)


OFFSETS = (115e-6, 100e-6, 130e-6, 90e-6)


def test_exact_data_give_the_truth() -> None:
    d = positions(OFFSETS)
    fits = bearing.fits(d, SOUND)
    s = bearing.statics(d, SOUND)
    for k, (axis, offset) in enumerate(zip(AXES, OFFSETS, strict=True)):
        assert fits[axis].beta == pytest.approx(BETA, rel=1e-7)
        assert fits[axis].offset == pytest.approx(offset, abs=1e-11)
        wide = bearing.with_gap(s, k, bearing.axis_fit(s, k, 1.05 * GAP).fit.terms, 1.05 * GAP)
        assert wide.terms == pytest.approx([BETA, offset, GAP], rel=1e-5)  # curvature tells the gap


def test_gains_and_zeros_are_taken_off() -> None:
    d = positions(OFFSETS)
    p = dict(SOUND)
    gains = {a: 1 + 0.01 * (k - 1.5) for k, a in enumerate(AXES)}
    for k, a in enumerate(AXES):
        p[f"gain_{a}"], p[f"runout_{a}"] = gains[a], 1e-6 * (k + 1)
        d.read[k] = gains[a] * (d.read[k] + p[f"runout_{a}"])
        for s, c in (("p", d.p), ("n", d.n)):
            p[f"gain_{a}_{s}"], p[f"offset_{a}_{s}"] = 1.004, 3e-3 * (k - 2)
            c[k] = 1.004 * c[k] + 3e-3 * (k - 2)
    for axis, offset in zip(AXES, OFFSETS, strict=True):
        fit = bearing.fits(d, p)[axis]
        assert (fit.beta, fit.offset) == (pytest.approx(BETA, rel=1e-3), pytest.approx(offset, abs=1e-7))


def test_erratum_the_sign_of_the_offset_goes_with_gravity() -> None:
    """T (2.6) with g_y above zero and an offset of -115 um is g_y below zero with +115 um: the same machine seen from below."""
    down, up = positions((115e-6,) * 4), positions((-115e-6,) * 4, gravity=G)
    mirrored = bearing.fits(Positions(-down.read, down.n, down.p), SOUND | {"gravity": -G})
    for axis in AXES:
        literal = bearing.fits(up, SOUND | {"gravity": -G})[axis]
        assert literal.offset == pytest.approx(-115e-6, abs=1e-10)
        assert mirrored[axis].offset == pytest.approx(-115e-6, abs=1e-10)
        wrong = bearing.fits(down, SOUND | {"gravity": -G})[axis]
        assert wrong.beta < 0  # gravity with the wrong sign makes no magnet


def test_erratum_the_linear_column_of_table_2_2_is_no_slope() -> None:
    """With the corrected sign the no-intercept model returns five times the bearing's slopes, with the other it does not."""
    same = bearing.fits(positions((115e-6,) * 4), SOUND)["yi"]
    k, stiffness = bearing.slopes(same.fit, GAP, BIAS)
    assert (
        pytest.approx(10.1, rel=0.01),
        pytest.approx(1.92e4, rel=0.01),
    ) == (4 * BETA * BIAS / GAP**2, 4 * BETA * BIAS**2 / GAP**3)
    assert k == pytest.approx(11.7, rel=0.02)  # at the offset they are a little steeper
    assert same.linear.terms[0] > 4 * k
    assert same.linear.terms[1] > 4 * stiffness
    against = bearing.fits(positions((-115e-6,) * 4), SOUND)["yi"]
    k, stiffness = bearing.slopes(against.fit, GAP, BIAS)
    assert against.linear.terms[0] < 1.5 * k


def test_the_best_of_several_is_between_them_and_shares_what_they_share() -> None:
    common = Influence("c", "c", 1.0, "1", "B", "normal")
    a = Estimate.of(10.0, Influence("a", "a", 1.0, "1", "B", "normal")) + Estimate.of(0.0, common)
    b = Estimate.of(12.0, Influence("b", "b", 2.0, "1", "B", "normal")) + Estimate.of(0.0, common)
    both = together([a, b])
    assert both.value == pytest.approx(10 * 0.8 + 12 * 0.2)
    assert both.u == pytest.approx(math.sqrt(0.8**2 + 0.4**2 + 1))
    steep = Estimate.of(11.0, common) * 5.0  # would get a weight below zero
    assert together([a, steep]).u <= a.u + 1e-12
