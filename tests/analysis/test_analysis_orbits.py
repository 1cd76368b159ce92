"""Orbits: ellipses against the drawn curve, precession, the mark, distances, and their uncertainty."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.analysis.orbits import ellipse, reach
from bench.analysis.vectors import Vectors
from bench.errors import AnalysisError

parts = st.floats(-10, 10, allow_nan=False).map(lambda v: round(v, 3))


def vectors(x: complex, y: complex, u: float = 1e-3) -> Vectors:
    return Vectors(np.array([x, y]), u**2 * np.eye(4), 14)


@given(parts, parts, parts, parts, st.booleans())
@settings(max_examples=60, deadline=None)
def test_the_axes_are_those_of_the_curve(a: float, b: float, c: float, d: float, x_to_y: bool) -> None:
    x, y = complex(a, b), complex(c, d)
    found = ellipse(vectors(x, y), x_to_y)
    turn = np.exp(1j * np.linspace(0, 2 * np.pi, 4_001))
    z = np.real(x * turn) + 1j * np.real(y * turn)
    assert found.major == pytest.approx(np.abs(z).max(), abs=2e-5)
    assert abs(found.minor) == pytest.approx(np.abs(z).min(), abs=0.02)  # where it is least the curve is steep
    area = np.sum(np.imag(np.conj(z[:-1]) * z[1:])) / 2 * (1 if x_to_y else -1)
    assert np.pi * found.major * found.minor == pytest.approx(area, abs=1e-3)
    assert found.mark == pytest.approx(z[0])
    if found.major - abs(found.minor) > 1e-2:
        peak = np.angle(z[np.abs(z).argmax()])
        away = (found.inclination - peak + np.pi / 2) % np.pi - np.pi / 2
        assert abs(away) * (found.major - abs(found.minor)) < 1e-2


def test_golden_orbits() -> None:
    circle = ellipse(vectors(2.0, -2j))  # y a quarter turn after x: forward
    assert (circle.major, circle.minor, circle.backward) == pytest.approx((2, 2, 0))
    assert circle.precession == "forward"
    assert ellipse(vectors(2.0, 2j)).precession == "backward"
    assert ellipse(vectors(2.0, 2j), x_to_y=False).precession == "forward"
    line = ellipse(vectors(1.0, 1.0))
    assert line.precession == "line"
    assert (line.major, line.inclination) == pytest.approx((np.sqrt(2), np.pi / 4))
    flat = ellipse(vectors(3j, 1.0))  # x = -3 sin, y = cos: the mark is at (0, 1), major along x
    assert (flat.major, flat.minor, flat.mark) == pytest.approx((3, 1, 1j))
    assert np.sin(flat.inclination) == pytest.approx(0, abs=1e-12)


@given(parts, parts, parts, parts)
@settings(max_examples=40, deadline=None)
def test_the_path_starts_at_the_mark_and_goes_with_the_motion(a: float, b: float, c: float, d: float) -> None:
    found = ellipse(vectors(complex(a, b), complex(c, d)))
    if abs(found.minor) < 1e-2:
        return
    px, py = found.path(181)
    turn = np.exp(1j * np.linspace(0, 2 * np.pi, 181))
    assert np.allclose(px, np.real(complex(a, b) * turn), atol=1e-6)
    assert np.allclose(py, np.real(complex(c, d) * turn), atol=1e-6)


def test_the_covariance_holds_what_scatters() -> None:
    rng, truth = np.random.default_rng(5), np.array([5 + 2j, -1 - 3j])
    root = rng.normal(0, 0.02, (4, 4))
    covariance = root @ root.T
    seen = []
    for _ in range(800):
        moved = truth.view(np.float64) + root @ rng.standard_normal(4)
        e = ellipse(Vectors(moved.view(np.complex128), covariance, 14))
        seen.append([e.major, e.minor, e.inclination, e.forward, e.backward])
    expected = ellipse(Vectors(truth, covariance, 14)).covariance
    assert np.allclose(np.cov(np.array(seen).T), expected, atol=0.15 * np.abs(expected).max())


def test_the_greatest_distance_counts_the_static_offset() -> None:
    theta = np.linspace(0, 2 * np.pi, 361)
    found = reach(30e-6 + 20e-6 * np.cos(theta), 10e-6 * np.sin(theta), 100e-6)
    assert found.d_max == pytest.approx(50e-6)
    assert found.share == pytest.approx(0.5)
    assert not found.contact
    assert reach(30e-6 + 20e-6 * np.cos(theta), 10e-6 * np.sin(theta), 100e-6, (30e-6, 0)).d_max == pytest.approx(20e-6)
    touched = reach(90e-6 + 20e-6 * np.cos(theta), 0 * theta, 100e-6)
    assert touched.contact
    assert touched.touched == 122  # 0 to 60 and 300 to 360 deg
    with pytest.raises(AnalysisError, match="clearance"):
        reach([0.0, 1.0], [0.0, 1.0], 0.0)
