"""When a set point jumped, by currents that answer it: a law that pushes as the set point goes is another answer."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import pytest

from procedures.amb_rotor.onset import DELAY_TICKS, onset, unlike
from procedures.step import slewing
from procedures.step.acting import UNLIKE
from procedures.step.steps import Case

TICK, TICKS, LAG = 5e-5, 10, 1.6e-4
BEGAN = 0.1003


def answer(
    push_s: float, noise: float, rng: np.random.Generator
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Means over ten ticks of 1 - e^(-t/LAG), and of `push_s` times its derivative; less a square of time for the rotor."""
    at = np.arange(0.0, 0.12, TICK)
    since = np.maximum(at - BEGAN - DELAY_TICKS * TICK, 0.0)
    decay = np.where(since > 0, np.exp(-since / LAG), 0.0)
    one = np.where(since > 0, 1 - decay, 0.0) + push_s / LAG * decay - (since / 4e-3) ** 2
    means = one[: len(one) // TICKS * TICKS].reshape(-1, TICKS).mean(axis=1)
    return TICK * TICKS * np.arange(1, len(means) + 1), means + rng.normal(0, noise, len(means))


@pytest.mark.parametrize(
    ("push_s", "early", "apart"), [(0.0, (-0.2, 0.2), (0.0, 0.015)), (3e-4, (0.5, 1.5), (0.03, 0.3))]
)
def test_a_push_is_found_early_and_unlike_a_jump(
    push_s: float, early: tuple[float, float], apart: tuple[float, float]
) -> None:
    """A derivative that is 0.3 ms of the gain: early by half of the lag and more; a jump is where it is, within 0.2 of it."""
    rng = np.random.default_rng(3)
    found, share = [], []
    for _ in range(20):
        t, current = answer(push_s, 0.008, rng)
        began, _ = onset(t, current, BEGAN - 3e-4, BEGAN + 4e-4, tick=TICK, ticks=TICKS, lag_s=LAG)
        found.append((BEGAN - began) / LAG)
        share.append(unlike(t, current, began, tick=TICK, ticks=TICKS, lag_s=LAG))
    assert early[0] < np.mean(found) < early[1]
    assert apart[0] <= np.mean(share) < apart[1]


def test_too_few_readings_tell_nothing() -> None:
    t = np.array([0.0, 1.0, 2.0])
    assert unlike(t, np.array([0.0, 0.0, 1.0]), 1.5, tick=1e-4, ticks=1, lag_s=1e-4) == 0.0


def test_a_light_end_turns_the_currents_round_before_they_show_a_jump() -> None:
    """At 1 kHz, by a law of the position alone: the current has its other sign after two samples, and is no jump either."""
    at = np.arange(0.0, 0.12, 1e-4)
    since = np.maximum(at - BEGAN - DELAY_TICKS * 1e-4, 0.0)
    one = np.where(since > 0, 1 - np.exp(-since / LAG), 0.0) - 2.2 * (1 - np.exp(-since / 8e-4) * (1 + since / 8e-4))
    t, current = 1e-3 * np.arange(1, 121), one.reshape(-1, 10).mean(axis=1)
    began, _ = onset(t, current, BEGAN - 7e-4, BEGAN + 6e-4, tick=1e-4, ticks=10, lag_s=LAG)
    assert unlike(t, current, began, tick=1e-4, ticks=10, lag_s=LAG) > UNLIKE


def test_the_note_names_both_causes() -> None:
    one = SimpleNamespace(case=Case("A", 0.0, "y", 1e-5, 1), unlike=0.13, start_s=6.9e-4)
    (note,) = slewing.of_starts([cast(Any, one)])
    assert "differentiates its error" in note.text
    assert "turns the currents round" in note.text
