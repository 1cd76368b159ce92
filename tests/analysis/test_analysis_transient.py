"""A passage through a resonance in closed form (by its integral), against the response when the speed stands."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import simpson

from bench.analysis.criticals import criticals
from bench.analysis.transient import local, series
from bench.errors import AnalysisError

NATURAL, ZETA = 430.0, 0.12
SPEED = np.linspace(150, 900, 150)
TINY = np.tile(1e-20 * np.eye(2), (SPEED.size, 1, 1))


def held(w: np.ndarray) -> np.ndarray:
    return np.asarray(1e-5 * w**2 / (NATURAL**2 - w**2 + 2j * ZETA * NATURAL * w))


def passed(w: np.ndarray, rate: float) -> np.ndarray:
    """x = integral of h(s) f(t - s), f = 1e-5 w^2 e^(j theta), as a vector on the angle."""
    s = np.linspace(0, 14 / (ZETA * NATURAL), 8001)
    damped = NATURAL * np.sqrt(1 - ZETA**2)
    h = np.exp(-ZETA * NATURAL * s) * np.sin(damped * s) / damped
    back = w[:, None]
    force = 1e-5 * (back - rate * s) ** 2 * np.exp(-1j * back * s + 0.5j * rate * s**2)
    return np.asarray(simpson(h * force, x=s, axis=1))


@pytest.mark.parametrize("rate", [60.0, -60.0, 200.0])
def test_the_lag_is_taken_off(rate: float) -> None:
    values, still = passed(SPEED, rate), np.zeros(SPEED.size)
    _, once, put_right = series(local(SPEED, values, TINY), SPEED, values, np.full(SPEED.size, rate), still)
    before, after, first = (np.abs(x - held(SPEED)).max() for x in (values, put_right, once))
    assert after < (0.05 if abs(rate) < 100 else 0.15) * before
    assert after < first
    assert after < 1.5 * np.abs(put_right - once).max()  # what the second term changes bounds it
    (raw,), (c,), (true,) = (criticals(SPEED, x, TINY, draws=2) for x in (values, put_right, held(SPEED)))
    assert (raw.speed - true.speed) * np.sign(rate) > 1.0  # late: too high on the way up, too low on the way down
    left = 0.1 if abs(rate) < 100 else 0.25
    assert abs(c.speed - true.speed) < left * abs(raw.speed - true.speed)
    assert abs(c.factor - true.factor) < 0.02 * true.factor


def test_a_block_is_a_mean_over_some_speeds() -> None:
    width = 30.0
    fine = np.linspace(-width / 2, width / 2, 201)
    means = np.array([simpson(held(w + fine), x=fine) / width for w in SPEED])
    *_, put_right = series(local(SPEED, means, TINY), SPEED, means, np.zeros(SPEED.size), np.full(SPEED.size, width))
    assert np.abs(put_right - held(SPEED)).max() < 0.1 * np.abs(means - held(SPEED)).max()


def test_refusal() -> None:
    some = np.ones(20)
    with pytest.raises(AnalysisError, match="ascending"):
        local(some, some.astype(complex), TINY[:20])
