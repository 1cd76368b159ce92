"""What a count leaves unknown of a place, against places that are drawn and braked step by step."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.rigfile import load_rig
from bench.rigfile.stage import axes_of
from bench.uncertainty import interval
from procedures.stages.counts import BRAKED, averaged, bounded, edges, erred, own_error, pitch_of, rested, topped
from procedures.step_following.fit import entered, lingered

ANGLE = axes_of(load_rig("rlsrm"))["angle"]
PITCH = pitch_of(ANGLE)
DRAWS = 20_000


def braked(speed: float, braking: float, dt: float = 1e-4) -> float:
    """How far something goes that is braked evenly, counts."""
    place = 0.0
    while speed > 0:
        place += speed * dt
        speed -= braking * dt
    return place


def test_where_axes_rest_that_come_in_with_any_speed() -> None:
    """Speeds up to the one that just gets through the count, whatever brakes."""
    for braking in (0.5, 8.0):
        fastest = math.sqrt(2 * braking)
        rests = np.array([braked(v, braking) for v in np.linspace(0, fastest, 400)])
        assert rests.max() == pytest.approx(1.0, abs=2e-3)
        assert rests.mean() == pytest.approx(BRAKED[0], abs=2e-3)
        assert rests.std() == pytest.approx(BRAKED[1], abs=2e-3)


def test_rounding_is_averaged_as_far_as_readings_differ() -> None:
    assert averaged([2.0, 2.0, 2.0]) == 1
    assert averaged([1.0, 2.0, 3.0]) == pytest.approx(1 / math.sqrt(3))
    assert averaged([1.0, 1.0, 2.0, 2.0]) == pytest.approx(1 / math.sqrt(2))


def test_the_encoder_of_the_rig() -> None:
    """0.08 degrees once a turn; the place along has no error of its own but its pitch."""
    axes = axes_of(load_rig("rlsrm"))
    assert own_error(axes["angle"]) == pytest.approx(0.08 * math.pi / 180)
    assert own_error(axes["x"]) == 0


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("just_in", [0.005, 0.05, None])  # of the count; any
def test_true_rests_are_held_also_where_all_stand_at_the_edge(way: int, just_in: float | None) -> None:
    """An integrator pushes until the reading changes: then all machines stand where they came in, and their errors lean all one
    way. With the middle of the count for value 93 % were held, leaning by 0.45 U."""
    rng = np.random.default_rng(2)
    place = rested("a", ANGLE, [0.0], [way]) - edges(ANGLE) - erred(ANGLE, "0")
    found = interval(place)
    gone = np.full(DRAWS, just_in) if just_in is not None else rng.random(DRAWS) ** 2
    own = rng.uniform(0.02, 0.08, DRAWS) * np.sin(rng.uniform(-math.pi, math.pi, DRAWS)) * math.pi / 180
    true = way * (gone - 0.5) * PITCH - rng.uniform(-0.5, 0.5, DRAWS) * PITCH - own
    held = np.mean((true >= found.low) & (true <= found.high))
    assert held >= 0.95
    assert abs(np.mean(true - place.value)) < 0.35 * found.U
    assert own_error(ANGLE) == pytest.approx(0.08 * math.pi / 180)
    assert np.quantile(np.abs(true - place.value), 0.95) > 0.75 * found.U  # nor is it wide


def test_where_a_reading_goes_on_changing_half_a_count_is_left() -> None:
    found = rested("a", ANGLE, [2 * PITCH, 3 * PITCH], [0, 0])
    assert found.value == pytest.approx(2.5 * PITCH)
    assert found.u == pytest.approx(PITCH / 2 / math.sqrt(2) / math.sqrt(2))
    mixed = rested("a", ANGLE, [0.0, 0.0], [1, 0])
    assert mixed.value == pytest.approx(-PITCH / 12)
    assert mixed.u == pytest.approx(PITCH / 2 * math.hypot(BRAKED[1], 0.5 / math.sqrt(2)))


@pytest.mark.parametrize("repeats", [1, 5])
def test_tops_are_held_by_laws_between_two(repeats: int) -> None:
    """All places of the last count alike likely, or all speeds at its edge, or something between these, the same for all
    repeats. With the middle of the count and half a count over the root of five 82 % were held; one has half a count."""
    rng = np.random.default_rng(3)
    tops = np.arange(float(repeats)) * PITCH
    found = interval(bounded("a", ANGLE, list(tops), topped("a", ANGLE, list(tops), [False] * repeats)))
    law = 1 / rng.uniform(1 / 3, 1 / 2, DRAWS) - 1
    true = tops.mean() + ((rng.random((DRAWS, repeats)) ** law[:, None]).mean(axis=1) - 0.5) * PITCH
    assert np.mean((true >= found.low) & (true <= found.high)) > 0.943
    half = PITCH / 2 / math.sqrt(repeats)
    assert pytest.approx(half if repeats == 1 else 1.248 * half, rel=0.01) == found.U
    assert repeats == 1 or np.mean(np.abs(true - tops.mean()) <= half) < 0.9


def test_tops_at_which_an_axis_stood_are_rests() -> None:
    tops = [0.0, PITCH, 2 * PITCH, 3 * PITCH]
    stood, rests = topped("a", ANGLE, tops, [True] * 4), rested("a", ANGLE, tops, [1] * 4)
    assert stood.value == pytest.approx(rests.value)
    assert stood.u == pytest.approx(rests.u)
    mixed = topped("a", ANGLE, tops, [True, True, False, False])
    assert mixed.value == pytest.approx((1.5 - (1 / 6 + 1 / 12) / 2) * PITCH)
    assert mixed.u == pytest.approx(math.hypot(BRAKED[1] / 2, 0.5 / 12 / math.sqrt(3)) * PITCH)


def test_which_way_a_reading_changed_last() -> None:
    """Up to its rest, back from an overshoot, to and fro at rest, never."""
    for place, way in (([0, 1, 2, 3, 3, 3], 1), ([0, 2, 4, 3, 3, 3], -1), ([0, 2, 4, 3, 4, 3], 0), ([3] * 6, 0)):
        assert entered(np.array(place, float), 3, 1.0) == way


def test_what_stands_at_its_greatest_reading() -> None:
    """Three samples from below a count to above it. Braked evenly, it is back after five times as long at most; what is there
    for more than 20 times as long stands."""
    up = np.array([0, 0, 1, 1, 2, 2, 3], float)
    for stays, stands in ((10, False), (60, False), (61, True)):
        assert lingered(np.concatenate([up, np.full(stays - 1, 3.0), [2.0, 1.0]]), 1.0) is stands
    assert lingered(np.concatenate([up, np.full(60, 3.0)]), 1.0)  # to its end
    assert not lingered(np.ones(100), 1.0)  # nobody saw how it came
