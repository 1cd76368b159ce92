"""Rational models of a few lines: exact on their own kind, the greatest abs without bias."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bench.analysis.rational import averaged, fitted, orders, top
from bench.errors import AnalysisError

HZ = np.arange(40.0, 110.0, 3.0)


def curve(hz: np.ndarray) -> np.ndarray:
    """Two close resonances on a smooth ground."""
    s = 2j * np.pi * hz
    w1, w2 = 2 * math.pi * 70.0, 2 * math.pi * 90.0
    return np.asarray(1.0 + 0.9 * w1 * s / (s**2 + 0.4 * w1 * s + w1**2) + 0.1 * w2 * s / (s**2 + 0.6 * w2 * s + w2**2))


def true_peak() -> tuple[float, float]:
    fine = np.linspace(HZ[0], HZ[-1], 100_001)
    size = np.abs(curve(fine))
    return float(size.max()), float(fine[size.argmax()])


def test_without_noise_the_curve_between_the_lines_is_found() -> None:
    model = fitted(HZ, curve(HZ), np.full(HZ.size, 1e-8), math.inf)
    fine = np.linspace(45.0, 105.0, 500)
    assert np.abs(model.at(fine) - curve(fine)).max() < 1e-3
    found, (value, at) = top(model, HZ[0], HZ[-1]), true_peak()
    assert found.value == pytest.approx(value, rel=1e-4)
    assert found.at == pytest.approx(at, abs=0.1)
    assert found.inside


def test_a_resonance_has_its_width() -> None:
    s = 2j * np.pi * HZ
    w = 2 * math.pi * 70.0
    z = w * s / (s**2 + 2 * 0.05 * w * s + w**2)
    assert fitted(HZ, z, np.full(HZ.size, 1e-6), math.inf).width(70.0) == pytest.approx(7.0, rel=0.05)


def test_the_greatest_of_noisy_lines_is_not_biased() -> None:
    value, z = true_peak()[0], curve(HZ)
    power = (0.01 * np.abs(z)) ** 2
    rng = np.random.default_rng(3)
    away = []
    for _ in range(40):
        noisy = z + np.sqrt(power / 2) * (rng.standard_normal(HZ.size) + 1j * rng.standard_normal(HZ.size))
        found = top(fitted(HZ, noisy, power, 200.0), HZ[0], HZ[-1])
        away.append((found.value - value) / found.u)
    assert abs(np.mean(away)) < 0.6
    assert 0.6 < np.std(away) < 1.5


def test_orders_that_differ_widen_what_they_say_together() -> None:
    """Two of equal weight that stand apart: the mean, and half of their distance in the uncertainty; one alone is as it is."""
    model = orders(HZ, curve(HZ), (0.01 * np.abs(curve(HZ))) ** 2, 200.0)[0]
    alone, other = top(model, HZ[0], HZ[-1]), replace(model, above=1.1 * model.above)
    assert averaged([model], HZ[0], HZ[-1]).value == pytest.approx(alone.value)
    apart = top(other, HZ[0], HZ[-1]).value - alone.value
    both = averaged([model, other], HZ[0], HZ[-1])
    assert both.value == pytest.approx(alone.value + apart / 2)
    assert both.u == pytest.approx(math.hypot(alone.u, apart / 2), rel=0.1)
    unlikely = averaged([model, replace(other, akaike=model.akaike + 50)], HZ[0], HZ[-1])
    assert unlikely.value == pytest.approx(alone.value)


@pytest.mark.parametrize("count", [4, 6])
def test_what_cannot_be_fitted_is_refused(count: int) -> None:
    """The first of the orders has five complex terms: six lines leave it two numbers, too few to say how well it fits."""
    with pytest.raises(AnalysisError, match="seven or more"):
        fitted(HZ[:count], curve(HZ[:count]), np.ones(count), 10.0)


def test_seven_lines_are_enough_for_one_pole() -> None:
    hz = np.arange(60.0, 81.0, 3.0)
    z = 1.0 + 5.0 / (1j * (hz - 70.0) + 4.0)
    assert hz.size == 7
    found = top(fitted(hz, z, np.full(7, 1e-10), math.inf), 60.0, 78.0)
    assert found.value == pytest.approx(1.0 + 5.0 / 4.0, rel=1e-4)
    assert found.at == pytest.approx(70.0, abs=0.05)
