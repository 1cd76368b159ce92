"""What steps of the angle that learn from each other are off their trend, whether a swing leaves its band, and where a rotor
stands that trembles at an edge of its encoder."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from procedures.angle_step.captured import _loose, _settling, alike
from procedures.angle_step.course import Course
from procedures.angle_step.fine import Fine
from procedures.angle_step.response import Move
from procedures.angle_step.standing import Began, began, stands
from procedures.angle_step.steps import Case, Done
from procedures.angle_step.trend import noise

COUNT = 2 * math.pi / 4096
SURE = Began(-0.5, False)
SIZE = 22.8 * COUNT


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


def stepping(
    rate: float, effect: float, at: int, rng: np.random.Generator
) -> tuple[list[list[float]], list[list[float]]]:
    """Values and starts of five steps each way, of which those one way begin a count further from step `at` on."""
    ways = [a + b * rate ** np.arange(5) + rng.normal(0, 0.01, 5) for a, b in ((9.0, 0.5), (8.0, -0.5))]
    starts = [np.where(np.arange(5) >= at, -1.5, -0.5), np.full(5, -0.97)]
    ways[0] += effect * (starts[0] + 0.5)
    return [list(w) for w in ways], [list(s) for s in starts]


@pytest.mark.parametrize("at", [2, 3, 4])
def test_steps_from_another_edge_are_no_noise(at: int) -> None:
    """An effect of thirty times the noise, which a trend alone takes for noise."""
    rng, told, blind = np.random.default_rng(2), [], []
    for _ in range(100):
        ways, starts = stepping(0.4, -0.3, at, rng)
        s, dof = noise(ways, starts)
        assert dof == 2
        told.append(s)
        blind.append(noise(ways)[0])
    assert np.sqrt(np.mean(np.square(told))) == pytest.approx(0.01, rel=0.2)
    assert np.median(blind) > 0.03


def test_a_step_that_no_edge_tells_the_start_of_is_of_no_trend() -> None:
    """It leaves too few to read the effect of a start from, which then is the loop's."""
    found = []
    for seed in range(60):
        ways, starts = stepping(0.4, -0.3, 4, np.random.default_rng(seed))
        ways[0][3] += 0.2
        starts[0][3] = math.nan
        s, dof = noise(ways, starts, -0.3)
        assert dof == 2
        found.append(s)
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(0.01, rel=0.2)


def test_starts_that_nothing_tells_leave_what_was_there() -> None:
    ways, _ = stepping(0.4, -0.3, 3, np.random.default_rng(2))
    assert noise(ways, [[math.nan] * 5] * 2, -0.3) == noise(ways)


def test_noise_of_few_steps() -> None:
    assert noise([[1.0, 2.0], [5.0, 5.0]]) == (pytest.approx(0.5), 2)
    assert noise([[1.0, 2.0, 3.0], [5.0, 4.0, 3.0]]) == (pytest.approx(0.0, abs=0.02), 2)


def swings(heights: list[float], began: Began = SURE, band: float = 2.0) -> list[Fine]:
    """Steps that settle at 70 ms, or at 105 ms where a swing of `heights` counts at 95 ms leaves the band."""
    t = np.arange(3000) * 1e-4
    out = []
    for k, height in enumerate(heights):
        y = np.where(t < 0.07, 20 * (1 - t / 0.07), 0.0) + height * np.exp(-(((t - 0.095) / 0.006) ** 2))
        of = Course(t, SIZE + y * COUNT, 87.0)
        out.append(Fine(k % 2 == 0, 0.02, 0.0, 0.3, None, of, SIZE, band * COUNT, 0, began))
    return out


def told(heights: list[float], noise: float, dof: int = 10, began: Began = SURE) -> tuple[float, float]:
    """Value and standard uncertainty of settling, s, where noise moves a turning point by so many counts."""
    found = _settling("here", swings(heights, began), (noise * COUNT, dof), alike(SIZE, COUNT), COUNT)
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


@pytest.mark.parametrize(("degrees", "counts"), [(2, 0.00444), (5, 0.00255), (12, 0.00210)])
def test_turning_points_of_a_larger_step_have_more_edges(degrees: float, counts: float) -> None:
    """0.09 of a count over the counts of the step, of which 4096 are a turn, and 0.002: by hand."""
    assert alike(math.radians(degrees), COUNT) == pytest.approx(counts, rel=0.01)


@pytest.mark.parametrize(("loose", "least"), [(False, 0.0), (True, 0.05)])
def test_a_loose_start_is_in_what_the_steps_say(loose: bool, least: float) -> None:
    found = _loose("here", swings([1.8] * 10, Began(-0.5, loose)))
    assert (found.value, found.u) == (0.0, pytest.approx(10**-0.5 / math.sqrt(12) if loose else 0.0))
    assert found.u >= least


def test_a_start_moves_a_rise_by_what_is_left_of_the_step() -> None:
    """A ramp of 70 ms: 0.9 of a start at 10 %, 0.1 at 90 %, over one speed."""
    t = np.arange(1000) * 1e-4
    ramp = Fine(True, 0.056, 0.07, 0.0, None, Course(t, np.minimum(t / 0.07, 1.0), 87.0), 1.0, 0.02, 0, SURE)
    assert ramp.longer == pytest.approx(0.8 * 0.07, rel=1e-3)


def resting(counts: list[float], reading: list[float], step: float = -0.2, turns: int = 0) -> Began:
    """Before a step away from 0, of the telemetry's `counts` and the capture's."""
    move = Move(step, *cast(Any, [None] * 9), rest_angle=np.array(counts) * COUNT)
    moved = Done(Case("static", 0.2, 200.0), move, 0, 0, (), 0, 0, target=step)
    return began(moved, np.array(reading) * COUNT + 2 * math.pi * turns, COUNT)


@pytest.mark.parametrize("turns", [0, 3])
@pytest.mark.parametrize(("step", "edge"), [(0.2, -0.5), (-0.2, 0.5)])
def test_a_step_begins_at_the_edge_that_was_last_seen(step: float, edge: float, turns: int) -> None:
    assert resting([-1.0, 0.0, 0.0, 0.0] * 75, [0.0] * 100, step, turns) == Began(edge, False)
    assert resting([1.0, 0.0, 0.0, 0.0] * 75, [0.0] * 50 + [-1.0] * 50, step, turns) == Began(edge, True)


def test_a_start_that_few_visits_tell_is_loose() -> None:
    assert resting(([-1.0] + [0.0] * 49) * 6, [0.0] * 100, 0.2) == Began(-0.5, False)
    assert resting(([-1.0] + [0.0] * 99) * 3, [0.0] * 100, 0.2) == Began(-0.5, True)
    nowhere = resting([0.0] * 300, [0.0] * 100, 0.2)
    assert (math.isnan(nowhere.edge), nowhere.loose) == (True, True)


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
    """From another edge, or from none that was seen; until then it was in the count between, half a count further."""
    found = stands(done([0.0, 1.0] * 300 + [0.0, -1.0] * 160), COUNT, 87 * 50 * COUNT)
    assert (found.error, found.half) == (pytest.approx(-0.5 * COUNT), COUNT / 2)
    found = stands(done([0.0] * 700 + [0.0, -1.0] * 75), COUNT, 87 * 50 * COUNT)
    assert (found.error, found.half) == (pytest.approx(-0.25 * COUNT, abs=0.01 * COUNT), COUNT / 2)


def test_a_rotor_that_all_but_stays_on_one_side_may_go_on() -> None:
    """Of 115 starts with so few visits 19 had another edge in one of four replicas, of 3485 with more one."""
    assert stands(done(([-1.0] + [0.0] * 89) * 6), COUNT, 87 * 50 * COUNT).half == COUNT / 2
    assert stands(done(([-1.0] + [0.0] * 39) * 12), COUNT, 87 * 50 * COUNT).half < 0.02 * COUNT


def test_visits_that_telemetry_does_not_see_make_no_stay_a_deep_one() -> None:
    """Back and forth within some ms, and 65 ms without a sample on the other side: it stands at its edge all the same."""
    found = stands(done([0.0, -1.0, -1.0] * 150 + [-1.0] * 65 + [0.0, -1.0, -1.0] * 40), COUNT, 87 * 50 * COUNT)
    assert found.error == pytest.approx(-0.5 * COUNT, abs=0.02 * COUNT)
    assert found.half < 0.03 * COUNT


@pytest.mark.parametrize("push", [87 * 50 * COUNT, math.nan])
def test_a_rotor_that_stays_within_a_count_is_anywhere_in_it(push: float) -> None:
    found = stands(done([7.0] * 400, target=7.3), COUNT, push)
    assert (found.error, found.half) == (pytest.approx(-0.3 * COUNT), COUNT / 2)
    assert stands(done([7.0, 8.0] * 200), COUNT, math.nan).half == COUNT / 2


def scattering(us: float, rng: np.random.Generator) -> list[Fine]:
    """Sixteen steps whose last swing leaves the band at 105 ms, and scatters by so many microseconds."""
    t = np.arange(3000) * 1e-4
    out = []
    for k, late in enumerate(rng.normal(0, us * 1e-6, 16)):
        y = 20 * np.exp(-(t - late) / 0.03) * np.cos(2 * np.pi * (t - late) / 0.07)
        of = Course(t, SIZE - y * COUNT, 87.0)
        out.append(Fine(k % 2 == 0, 0.02, 0.0, 0.3, None, of, SIZE, 0.5 * COUNT, 0, SURE))
    return out


def test_noise_of_the_first_top_is_not_that_of_the_last_swing() -> None:
    """0.02 of a count there; times scatter by 20 us, far less than that would make of them."""
    rng = np.random.default_rng(3)
    found = [_settling("here", scattering(20.0, rng), (0.02 * COUNT, 10), 0.0, COUNT) for _ in range(40)]
    assert np.sqrt(np.mean([e.u**2 for e in found])) == pytest.approx(5e-6, rel=0.1)
    assert {next(iter(e.sensitivities)).dof for e in found} == {9.0}
    assert np.std([e.value for e in found], ddof=1) == pytest.approx(5e-6, rel=0.3)


def test_a_start_further_on_settles_earlier() -> None:
    of = scattering(0.0, np.random.default_rng(3))[0].settled
    smaller = of.course.y + (SIZE - of.course.y) / 22.8  # a start that is a count further
    again = replace(of, course=replace(of.course, y=smaller))
    assert of.earlier(COUNT) == pytest.approx(of.time - again.time, rel=0.1)
    assert of.time > again.time
