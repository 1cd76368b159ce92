"""An angle step by telemetry alone, which tells means of a millisecond: peaks, rise, and how long an amplifier cut."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.rigfile import load_rig
from procedures.angle_step import estimates
from procedures.angle_step.response import Move, curve, excursion, response
from procedures.angle_step.steps import Case, Done

Array = npt.NDArray[np.float64]
COUNT = 2 * math.pi / 4096
SAMPLE = 1e-3
RIGS = tuple(load_rig(name) for name in ("tsbs6", "tsbs12"))


def means(bump_s: float, phase: float, n: int = 60) -> Array:
    """(2, n): half a sine of 10 um downwards that begins `phase` samples after the tenth, as exact means of each sample."""
    ends = (np.arange(n + 1) - 10 - phase) * SAMPLE
    angle = np.clip(ends / bump_s, 0, 1) * math.pi
    below = 10e-6 * np.diff(1 - np.cos(angle)) * bump_s / math.pi / SAMPLE
    return np.array([np.zeros(n), -below])


@settings(max_examples=40, deadline=None)
@given(bump_s=st.floats(5e-3, 30e-3), phase=st.floats(0, 1))
def test_a_peak_between_means_is_read_to_four_thousandths(bump_s: float, phase: float) -> None:
    """Of 9 ms or more; the largest of a parabola through the means themselves is up to 2 % low there, 7 % at 5 ms. What a
    shorter one is off, the curve of more samples tells."""
    found = excursion(means(bump_s, phase), np.zeros((2, 100)))
    if bump_s > 9e-3:
        assert found.peak == pytest.approx(10e-6, rel=0.004)
    assert found.towards == pytest.approx([0.0, -1.0])
    assert abs(found.peak - 10e-6) < found.otherwise + 0.002 * 10e-6
    assert (found.away, found.floor) == (0.0, 0.0)


def test_a_curve_has_the_means_that_it_is_drawn_through() -> None:
    """A parabola a + b t + c t^2 has the mean a + b t + c (t^2 + 1/12) over a sample."""
    t = np.arange(30.0)
    path = np.array([3 - 2 * t + 0.5 * (t**2 + 1 / 12), 1 + t])
    places = (np.arange(300) + 0.5) / 10 - 0.5
    inside = slice(30, 270)  # the ends have neighbours on one side
    for reach, degree in ((2, 2), (3, 4)):
        found = curve(path, reach, degree)[:, inside]
        np.testing.assert_allclose(
            found, np.array([3 - 2 * places + 0.5 * places**2, 1 + places])[:, inside], rtol=1e-9
        )


@settings(max_examples=30, deadline=None)
@given(bump_s=st.floats(9e-3, 30e-3), phase=st.floats(0, 1))
def test_readings_are_places_and_no_means(bump_s: float, phase: float) -> None:
    """Where a rig file says `binding.samples = "reading"`; taken for means they would come out higher."""
    angle = np.clip((np.arange(60) - 9.5 - phase) * SAMPLE / bump_s, 0, 1) * math.pi
    found = excursion(np.array([np.zeros(60), -10e-6 * np.sin(angle)]), np.zeros((2, 100)), means=False)
    assert found.peak == pytest.approx(10e-6, rel=0.004)


def stepping(size: float, frequency: float, damping: float, late: float, noise: Array) -> Move:
    """Counts of a step of second order whose samples begin `late` s after the answer."""
    t = np.arange(1500) * SAMPLE
    y = size * second_order(t + late, frequency, damping)
    flat = noise[:, :1500]
    return Move(size, t, np.floor(y / COUNT + 0.5) * COUNT, flat, flat, np.zeros((4, 1500)), np.zeros(1500, bool),
                noise[:, 1500:], noise[:, 1500:], np.zeros((4, noise.shape[1] - 1500)))  # fmt: skip


def second_order(t: Array, frequency: float, damping: float) -> Array:
    wd = frequency * math.sqrt(1 - damping**2)
    return 1 - np.exp(-damping * frequency * t) * (np.cos(wd * t) + damping * frequency / wd * np.sin(wd * t))


@pytest.mark.parametrize(("degrees", "frequency", "damping"), [(5, 70, 0.4), (10, 70, 0.4), (15, 90, 0.3)])
def test_a_rise_of_twenty_milliseconds_is_not_too_long(degrees: float, frequency: float, damping: float) -> None:
    """In the mean over where its samples fall; a line through the samples about a crossing made it 0.1 ms longer."""
    size, still = math.radians(degrees), np.zeros((2, 1800))
    fine = np.linspace(0, 0.1, 1_000_001)
    exact = second_order(fine, frequency, damping)
    true = fine[np.argmax(exact > 0.9)] - fine[np.argmax(exact > 0.1)]
    lates = np.linspace(0, SAMPLE, 40, endpoint=False)
    found = [response(stepping(size, frequency, damping, late, still), 0.02 * size).rise for late in lates]
    assert np.mean(found) == pytest.approx(true, abs=0.04e-3)


@settings(max_examples=20, deadline=None)
@given(cut=st.lists(st.integers(1, 10), min_size=0, max_size=12))
def test_a_sample_that_a_cut_fell_in_holds_one_tick_of_it_or_ten(cut: list[int]) -> None:
    """The derivative of counts cuts from tick to tick."""
    noise = np.random.default_rng(1).normal(0, 1e-8, (2, 1800))
    size = math.radians(10)
    move = stepping(size, 70, 0.4, 0.0, noise)
    move.saturated[1 : 1 + len(cut)] = True
    case = Case("static", size, 1000.0)
    back = Move(-size, move.t, -move.angle, *(getattr(move, f) for f in list(Move.__dataclass_fields__)[3:]))
    moves = [Done(case, m, 0, 0, (), 0, 0, target=m.step if m is move else 0.0) for m in (move, back) * 2]
    true = sum(cut) * 1e-4
    for rig in RIGS:
        found = estimates.by_case(moves, rig, 0.02, COUNT, 50.0)[case].estimates["saturated"]
        assert found.value - 0.45e-3 * len(cut) - 1e-4 <= true <= found.value + 0.45e-3 * len(cut) + 1e-4
        assert found.value == pytest.approx(0.55e-3 * len(cut))
        assert found.u * math.sqrt(3) >= 0.45e-3 * len(cut)
