"""When set points jumped, by many answers laid over each other: a fast loop under more noise than a single answer stands."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from procedures.amb_rotor.onset import onset
from procedures.tracking.checks import CLEAR

Array = npt.NDArray[np.float64]
TICK, LAG, ANSWERS, PERIOD = 5e-5, 1.5e-4, 400, 1e-3


def answers(jump: float, begun: float, seed: int, ticks: int) -> tuple[Array, Array]:
    """Samples (n,) s and A of a loop whose answer to a jump crosses zero 3 ms later; 1 A of noise in a sample, of which half
    the variance is one value for each answer."""
    rng, t, current = np.random.default_rng(seed), [], []
    for _ in range(ANSWERS):
        at = np.arange(-4e-3, 6e-3, PERIOD) + rng.uniform(0, PERIOD)
        since = at[:, None] - TICK * np.arange(1, ticks + 1) - begun - 2 * TICK
        since = np.maximum(since, 0.0)
        told = (1 - np.exp(-since / LAG)) * np.exp(-since / 4e-3) * np.cos(np.pi * since / 6e-3)
        t.append(at)
        current.append(jump * told.mean(axis=1) + np.sqrt(0.5) * (rng.normal() + rng.normal(size=at.size)))
    return np.concatenate(t), np.concatenate(current)


def seen(jump: float, begun: float, seed: int, ticks: int) -> tuple[float, float]:
    t, current = answers(jump, begun, seed, ticks)
    return onset(t, current, 0.0, 2 * PERIOD, tick=TICK, ticks=ticks, lag_s=LAG, period_s=PERIOD, answers=ANSWERS)


@pytest.mark.parametrize("ticks", [1, 20])
@pytest.mark.parametrize("begun", [0.0, 4e-5])
def test_a_start_that_no_single_answer_shows_is_seen_in_all(begun: float, ticks: int) -> None:
    found, clear = np.mean([seen(4.0, begun, seed, ticks) for seed in range(4)], axis=0)
    assert found == pytest.approx(begun, abs=6e-5)
    assert clear > CLEAR


@pytest.mark.parametrize("seed", range(6))
def test_no_answer_is_not_seen(seed: int) -> None:
    assert seen(0.0, 0.0, seed, 20)[1] < CLEAR / 2
