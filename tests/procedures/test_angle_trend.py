"""What steps of the angle that learn from each other are off their trend, whether a swing leaves its band, and where a rotor
stands that trembles at an edge of its encoder."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
import pytest

from procedures.angle_step.captured import _settling
from procedures.angle_step.course import Course
from procedures.angle_step.fine import Fine
from procedures.angle_step.response import Move
from procedures.angle_step.standing import stands
from procedures.angle_step.steps import Case, Done
from procedures.angle_step.trend import noise

COUNT = 2 * math.pi / 4096


@pytest.mark.parametrize("repeats", [5, 6, 8])
@pytest.mark.parametrize("rate", [0.3, 0.7, 0.95])
def test_what_steps_learn_is_no_noise(repeats: int, rate: float) -> None:
    """A trend of fifty times the noise, and a first step that begins elsewhere."""
    rng, found = np.random.default_rng(1), []
    for _ in range(100):
        ways = [a + b * rate ** np.arange(repeats) + rng.normal(0, 0.01, repeats) for a, b in ((9.0, 0.5), (8.0, -0.5))]
        ways[1][0] += 0.4
        s, dof = noise([list(way) for way in ways])
        assert dof == 2 * (repeats - 3) - 1
        found.append(s)
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(0.01, rel=0.15)


def test_noise_of_few_steps() -> None:
    assert noise([[1.0, 2.0], [5.0, 5.0]]) == (pytest.approx(0.5), 2)
    assert noise([[1.0, 2.0, 3.0], [5.0, 4.0, 3.0]]) == (pytest.approx(0.0, abs=0.02), 2)


def swings(heights: list[float], band: float = 2.0) -> list[Fine]:
    """Steps that settle at 70 ms, or at 105 ms where a swing of `heights` counts at 95 ms leaves the band."""
    t = np.arange(3000) * 1e-4
    out = []
    for k, height in enumerate(heights):
        y = np.where(t < 0.07, 20 * (1 - t / 0.07), 0.0) + height * np.exp(-(((t - 0.095) / 0.006) ** 2))
        out.append(Fine(k % 2 == 0, 0.02, 0.0, 0.3, None, Course(t, y * COUNT, 87.0), 0.0, band * COUNT, 0))
    return out


def told(heights: list[float], noise: float, dof: int = 10) -> tuple[float, float]:
    """Value and standard uncertainty of settling, s, where noise moves a turning point by so many counts."""
    found = _settling("here", swings(heights), (noise * COUNT, dof), COUNT)
    return found.value, found.u


@pytest.mark.parametrize(("height", "settles"), [(1.8, 0.063), (2.2, 0.098)])
def test_a_swing_that_surely_stays_or_leaves_is_no_jump(height: float, settles: float) -> None:
    value, u = told([height] * 10, 0.012)
    assert value == pytest.approx(settles, abs=2e-3)
    assert u < 5e-4


def test_a_swing_that_ends_at_the_band_is_told_by_how_often_it_leaves() -> None:
    """Half of them do, one or the other by chance."""
    low, high = told([1.8] * 10, 0.012)[0], told([2.2] * 10, 0.012)[0]
    value, u = told([2.0] * 10, 0.012)
    assert low + 0.4 * (high - low) < value < low + 0.6 * (high - low)
    assert u > 0.1 * (high - low)
    likely, less = told([2.03] * 10, 0.012)
    assert value < likely < high
    assert less < u


def test_noise_that_few_steps_tell_may_be_more() -> None:
    """A swing 0.03 of a count within the band: one of forty left it, where three degrees of freedom told 0.003 of a count."""
    assert told([1.97] * 10, 0.003, 3)[1] > 2e-4
    assert told([1.97] * 10, 0.003, 1000)[1] < 1e-4


def done(counts: list[float], target: float = 0.0) -> Done:
    """A step back to `target` counts of the encoder that ends in telemetry of `counts`."""
    angle = np.array(counts) * COUNT
    move = Move(-0.2, np.arange(len(angle)) * 1e-3, angle - target * COUNT - 0.2, *cast(Any, [None] * 7))
    return Done(Case("static", 0.2, 200.0), move, 0, 0, (), 0, 0, target=target * COUNT)


def test_a_rotor_that_trembles_stands_at_the_edge() -> None:
    """Three quarters of the time on the upper side: the mean of its counts is a quarter of a count off."""
    found = stands(done([-1.0, 0.0, 0.0, 0.0] * 100), COUNT, 87 * 50 * COUNT)
    assert found.error == pytest.approx(-0.5 * COUNT, abs=0.01 * COUNT)
    assert found.half < 0.02 * COUNT


def test_the_longer_it_stays_away_the_less_is_known() -> None:
    halves = [stands(done(([-1.0] * k + [0.0] * k) * (600 // k)), COUNT, 87 * 50 * COUNT).half for k in (3, 10, 40)]
    assert halves[0] < halves[1] < halves[2] <= COUNT / 2


def test_a_rotor_that_came_to_its_edge_not_long_ago_might_have_come_later() -> None:
    found = stands(done([0.0, 1.0] * 300 + [0.0, -1.0] * 160), COUNT, 87 * 50 * COUNT)
    assert (found.error, found.half) == (pytest.approx(-0.5 * COUNT), COUNT / 2)


def test_a_rotor_that_all_but_stays_on_one_side_may_go_on() -> None:
    """One of four replicas had gone to the next edge, and others a part of the time."""
    assert stands(done(([-1.0] + [0.0] * 24) * 20), COUNT, 87 * 50 * COUNT).half == COUNT / 2


@pytest.mark.parametrize("push", [87 * 50 * COUNT, math.nan])
def test_a_rotor_that_stays_within_a_count_is_anywhere_in_it(push: float) -> None:
    found = stands(done([7.0] * 400, target=7.3), COUNT, push)
    assert (found.error, found.half) == (pytest.approx(-0.3 * COUNT), COUNT / 2)
    assert stands(done([7.0, 8.0] * 200), COUNT, math.nan).half == COUNT / 2
