"""Errata of the thesis that this project uses: each literal equation gives a wrong number where the corrected one is right.

A static, noise-free bearing pair carries known weights; the literal and the corrected equilibrium are solved on the same
currents.
"""

from __future__ import annotations

import numpy as np
import pytest

from procedures.amb_calibration.fit import hung_shares

G, MASS = 9.81, 10.2
L_IA, L_OA, L_D = 0.115, 0.010, 0.160
K_I, K_O = 73.2, 74.4
HUNG = np.array([0.0, 0.5, 1.0, 2.0, 3.0])


def currents() -> tuple[np.ndarray, np.ndarray]:
    """Control currents of linear bearings that carry the shaft and the hung masses, from forces and moments."""
    out = []
    for hung in HUNG:
        forces = np.linalg.solve([[1, 1], [L_IA, -L_OA]], [(MASS + hung) * G, -L_D * hung * G])
        out.append(forces)
    forces = np.array(out)
    return forces[:, 0] / K_I, forces[:, 1] / K_O


def stacked(rows: list[tuple[float, float]], right: list[float]) -> np.ndarray:
    return np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]


def test_signs_of_the_stacked_system() -> None:
    """After (6.11) the moment rows must be l_ia K_i di_i - l_oa K_o di_o = - l_D dm g."""
    i, o = currents()
    di, do, dm = np.diff(i), np.diff(o), np.diff(HUNG)
    rows = [r for a, b in zip(di, do, strict=True) for r in ((a, b), (L_IA * a, -L_OA * b))]
    right = [r for m in dm for r in (m * G, -L_D * m * G)]
    literal = [r for m in dm for r in (m * G, L_D * m * G)]
    assert stacked(rows, right) == pytest.approx([K_I, K_O], rel=1e-9)
    wrong = stacked(rows, literal)
    assert wrong[0] < 0
    assert abs(wrong[1] / K_O - 1) > 0.5


def test_right_sides_are_mass_differences() -> None:
    """After (6.11) the right sides carry m[k], not its differences: the constants come out by factors too large."""
    i, o = currents()
    di, do = np.diff(i), np.diff(o)
    rows = [r for a, b in zip(di, do, strict=True) for r in ((a, b), (L_IA * a, -L_OA * b))]
    literal = [r for m in HUNG[1:] for r in (m * G, -L_D * m * G)]
    wrong = stacked(rows, literal)
    assert abs(wrong[0] / K_I - 1) > 0.2
    assert abs(wrong[1] / K_O - 1) > 0.2


def test_a_linear_fit_is_five_per_cent_off_away_from_the_magnetic_centre() -> None:
    """F is quadratic in i off the magnetic centre (T 2.4), and the outboard AMB carries its share of the shaft."""
    gap, xi, bias = 5e-4, 50e-6, 3.0
    beta = 74.4 * gap**2 / (4 * bias)
    near, far = beta / (gap - xi) ** 2, beta / (gap + xi) ** 2
    k, k2 = 2 * bias * (near + far), near - far
    forces = MASS * G * L_IA / (L_IA + L_OA) + (1 + 0.150 / 0.125) * HUNG * G
    i = (-k + np.sqrt(k**2 - 4 * k2 * (k2 * bias**2 - forces))) / (2 * k2)
    linear = np.polyfit(i, forces, 1)[0]
    quadratic = np.polyfit(i, forces, 2)[1]
    assert quadratic == pytest.approx(k, rel=1e-9)
    assert abs(linear / k - 1) > 0.03


def test_shares_of_a_hung_weight() -> None:
    """(6.11) solved by hand for d = 150 mm, s = 125 mm: -1.2 and 2.2."""
    assert hung_shares(0.150, 0.125) == pytest.approx((-1.2, 2.2))


def test_effective_mass_of_the_text() -> None:
    """m' drops the inboard force: about the inboard sensor plane it is 6.31 kg, not 6.55."""
    m, j, l_m, l_is, l_os = 10.2, 0.116, 0.122, 0.161, 0.052
    assert m * j / (j + m * l_os * l_m) == pytest.approx(6.55, abs=0.01)
    assert (j + m * l_is**2) / ((l_m + l_is) * (l_os + l_is)) == pytest.approx(6.31, abs=0.01)
