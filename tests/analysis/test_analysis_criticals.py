"""Criticals of single-degree rotors in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from bench.analysis.criticals import criticals
from bench.analysis.peaks import noise, smoother
from bench.errors import AnalysisError

NATURAL = 648.4253  # rad/s, translation of the rotor that ROSS confirmed


def response(w: np.ndarray | float, zeta: float) -> np.ndarray:
    w = np.asarray(w)
    return np.asarray(1e-5 * w**2 / (NATURAL**2 - w**2 + 2j * zeta * NATURAL * w))


def closed_form(zeta: float) -> tuple[float, float]:
    """Speed of the greatest amplitude and the factor by half power."""
    top = NATURAL / np.sqrt(1 - 2 * zeta**2)
    level = np.abs(response(top, zeta)) * np.sqrt(0.5)
    low = brentq(lambda w: np.abs(response(w, zeta)) - level, 1, top)
    high = brentq(lambda w: np.abs(response(w, zeta)) - level, top, 50 * top)
    return top, top / (high - low)


@pytest.mark.parametrize("zeta", [0.02, 0.05, 0.129685])
def test_speed_and_factor_are_the_closed_forms(zeta: float) -> None:
    w = np.linspace(200, 1500, 260)[::-1]  # a coast-down
    found = criticals(w, response(w, zeta), np.tile(1e-18 * np.eye(2), (w.size, 1, 1)), draws=20)
    assert len(found) == 1
    speed, factor = closed_form(zeta)
    assert found[0].speed == pytest.approx(speed, rel=2e-3)
    assert found[0].factor == pytest.approx(factor, rel=0.01)
    best = minimize_scalar(lambda v: -np.abs(response(v, zeta)), bounds=(300, 1500), method="bounded")
    assert found[0].amplitude == pytest.approx(-best.fun, rel=5e-3)
    assert found[0].critically_damped == (factor < 2.5)


def test_the_intervals_hold_the_truth() -> None:
    """30 coast-downs of 1 % noise: 0.95 of them, less 3.3 sigma."""
    w, zeta, u = np.linspace(300, 1300, 150), 0.06, 8e-7
    truth, hits = np.array(closed_form(zeta)), []
    for seed in range(30):
        noise = np.random.default_rng([3, seed]).normal(0, u, (w.size, 2)).view(np.complex128)[:, 0]
        found = criticals(w, response(w, zeta) + noise, np.tile(u**2 * np.eye(2), (w.size, 1, 1)), draws=40, seed=seed)[
            0
        ]
        away = np.array([found.speed, found.factor]) - truth
        hits.append(np.abs(away) <= 2 * np.sqrt(found.covariance[[0, 2], [0, 2]]))
    assert (np.mean(hits, axis=0) >= 0.82).all()


@pytest.mark.parametrize("seed", range(6))
def test_a_curve_in_much_noise_gives_criticals_or_none(seed: int) -> None:
    """Noise of a quarter of the peak: smoothed, some greatest values have no width at all, and some are lost."""
    w, u = np.linspace(300, 1300, 150), 2e-5
    off = np.random.default_rng([3, seed]).normal(0, u, (w.size, 2)).view(np.complex128)[:, 0]
    found = criticals(w, response(w, 0.06) + off, np.tile(u**2 * np.eye(2), (w.size, 1, 1)), draws=40, seed=seed)
    assert all(np.isfinite([c.speed, c.amplitude]).all() for c in found)
    assert all(not np.isfinite(c.factor) or c.high > c.low for c in found)


def test_bumps_that_noise_makes_are_not_certain_and_a_peak_in_the_same_noise_is() -> None:
    """Noise of a fifth of a flat response, and of a tenth of a resonance's greatest amplitude."""
    w = np.linspace(70, 565, 112)
    for seed in range(20):
        off = np.random.default_rng([5, seed]).normal(0, 1, (w.size, 2)).view(np.complex128)[:, 0]
        flat, sharp = 1 + w / 565, response(w * 3, 0.06)
        bumps = criticals(w, flat + 0.2 * off, np.tile(0.04 * np.eye(2), (w.size, 1, 1)), draws=60, seed=seed)
        assert not any(c.certain for c in bumps), [c.clear for c in bumps]
        u = 0.1 * np.abs(sharp).max()
        found = criticals(w, sharp + u * off, np.tile(u**2 * np.eye(2), (w.size, 1, 1)), draws=60, seed=seed)
        (true,) = [c for c in found if c.certain]
        assert true.speed == pytest.approx(closed_form(0.06)[0] / 3, rel=0.05)


@pytest.mark.parametrize("told", [1.0, 1.5])
def test_blocks_that_scatter_more_than_they_are_said_to_are_seen(told: float) -> None:
    """Ratio of the mean squares, of a curve with noise `told` times as large as its covariance says."""
    w, u = np.linspace(300, 1300, 300), 3e-7
    said = np.tile(u**2 * np.eye(2), (w.size, 1, 1))
    values = response(w, 0.1) + told * noise(said, 11, 1)[0]
    smooth = smoother(w, values, said)
    found = smooth.excess(values, smooth.at_lines(values) + noise(said, 12, 40))
    assert found.shape == w.shape
    assert found.mean() == pytest.approx(told**2, rel=0.15)


def test_two_criticals_and_a_half_power_point_outside() -> None:
    w = np.linspace(620, 2500, 300)
    z = response(w, 0.02) + 4e-6 * w**2 / (1800.0**2 - w**2 + 2j * 0.02 * 1800 * w)
    found = criticals(w, z, np.tile(1e-18 * np.eye(2), (w.size, 1, 1)), draws=10)
    fine = np.linspace(620, 2500, 100_001)
    size = np.abs(response(fine, 0.02) + 4e-6 * fine**2 / (1800.0**2 - fine**2 + 2j * 0.02 * 1800 * fine))
    expected = [fine[np.argmax(size * (fine < 1000))], fine[np.argmax(size * (fine > 1000))]]
    assert [c.speed for c in found] == pytest.approx(expected, abs=1.5)
    near = criticals(w[w > 637], z[w > 637], np.tile(1e-18 * np.eye(2), ((w > 637).sum(), 1, 1)), draws=10)
    assert np.isnan(near[0].factor)
    assert np.isfinite(near[0].amplitude)


def test_half_power_that_the_noise_hides_is_not_told() -> None:
    """The record begins where the amplitude is 0.70 of the greatest: half power is on it, but not on every drawn curve."""
    zeta, u = 0.1, 2e-6
    top = closed_form(zeta)[0]
    begin = brentq(lambda w: np.abs(response(w, zeta)) - 0.70 * np.abs(response(top, zeta)), 1, top)
    w = np.linspace(begin, 1500, 120)
    covariance = np.tile(u**2 * np.eye(2), (w.size, 1, 1))
    (found,) = criticals(w, response(w, zeta), covariance, draws=100)
    assert np.isnan(found.factor)
    assert found.speed == pytest.approx(top, rel=0.02)
    (clear,) = criticals(w, response(w, zeta), covariance * 1e-8, draws=20)
    assert clear.factor == pytest.approx(closed_form(zeta)[1], rel=0.02)


def test_no_critical_and_refusal() -> None:
    w = np.linspace(100, 300, 50)
    assert criticals(w, response(w, 0.1), np.tile(1e-18 * np.eye(2), (50, 1, 1)), draws=5) == []
    with pytest.raises(AnalysisError, match="speeds of their own"):
        criticals(np.ones(20), np.ones(20), np.tile(np.eye(2), (20, 1, 1)))
