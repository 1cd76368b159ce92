"""Settling of the angle by telemetry alone: a swing that ends at its band, within a count, by chance."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import pytest
from test_angle_edges import COUNT, kicked

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import flown
from bench.procedure import Measured
from bench.uncertainty import interval
from procedures.angle_step import steps
from procedures.angle_step.counted import settling_time
from procedures.angle_step.course import Course
from procedures.angle_step.response import Move
from procedures.angle_step.settling import Settling, settled
from procedures.angle_step.steps import Case, Done

Array = npt.NDArray[np.float64]
BAND = 2 * COUNT
PERIOD = 10  # ticks


@cache
def swung(size: float) -> tuple[Array, Array]:
    return kicked(size)


def told(size: float, way: float, phase: int) -> Done:
    """Telemetry of a step that answers at tick 100, `phase` ticks after the first sample: counts, and means of the current."""
    y, torque = swung(size)
    ticks = np.arange(100 - phase, len(y), PERIOD)
    counts = np.floor(y[ticks] / COUNT + 0.5) * COUNT
    means = np.array([torque[max(k - PERIOD + 1, 0) : k + 1].mean() for k in ticks])
    nothing = cast(Any, None)
    move = Move(way * size, (ticks - ticks[0]) * 1e-4, way * counts, nothing, nothing, np.tile(way * means, (4, 1)),
                nothing, nothing, nothing, np.zeros((4, 1)))  # fmt: skip
    return Done(Case("static", size, 200.0), move, 0, 0, (), 0, 0, target=way * size)


def settles(size: float) -> float:
    y, _ = swung(size)
    return float(np.flatnonzero(np.abs(y - size) > BAND)[-1] - 99) * 1e-4


def told_by_all(size: float) -> tuple[float, float]:
    """Value and U of steps both ways, s."""
    found = settling_time("here", [told(size, way, phase) for way in (1.0, -1.0) for phase in (2, 5, 8)], BAND, COUNT)
    return found.value, interval(found).U


TOUCHING = np.linspace(0.0240, 0.0260, 9)  # rad: a swing ends within a tenth of a count of the band


@pytest.mark.parametrize("size", [0.031, 0.0349, 0.0362, 0.045, 0.087])
def test_telemetry_tells_settling_between_its_counts(size: float) -> None:
    value, unsure = told_by_all(size)
    assert value == pytest.approx(settles(size), abs=max(unsure, 0.6e-3))


def test_a_swing_that_touches_its_band_is_in_the_interval() -> None:
    """Half a swing, 40 ms, is the difference between a swing that leaves and one that does not; its count
    tells one for the other, and by itself says that it is sure."""
    assert max(map(settles, TOUCHING)) - min(map(settles, TOUCHING)) > 25e-3
    for size in TOUCHING:
        value, unsure = told_by_all(size)
        assert abs(value - settles(size)) <= 2 * unsure
    assert max(told_by_all(size)[1] for size in TOUCHING) > 5e-3


def touched(height: float, forward: bool) -> Settling:
    t = np.arange(3000) * 1e-4
    y = np.where(t < 0.07, 20 * (1 - t / 0.07), 0.0) + height * np.exp(-(((t - 0.095) / 0.006) ** 2))
    return Settling(forward, Course(t, 0.02 + y * COUNT, 87.0), 0.02, BAND, 0.0)


def test_turning_points_of_one_way_may_be_off_alike() -> None:
    """One way has the jump of 35 ms by an even chance and the other has none: half a jump, half of the time."""
    found = settled("here", [touched(2.0, True), touched(1.0, False)] * 5, (1e-6 * COUNT, 10), 0.01, COUNT)

    assert found.u == pytest.approx(0.035 / 4, rel=0.15)


def test_a_line_from_edge_to_edge_is_short_of_a_turning_point() -> None:
    """Too few edges for the torque to say what the angle does between them."""
    lines, read = (Course(np.zeros(2), np.zeros(2), gain) for gain in (math.nan, 87.0))
    assert lines.unsure(0.01, COUNT) == pytest.approx(COUNT / math.sqrt(3))
    assert read.unsure(0.01, COUNT) == pytest.approx(0.01 * COUNT)


def test_a_rig_without_captures_has_its_settling_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steps, "read_swing", lambda recording, number: None)
    plan = {"standstill_s": 0.3, "record_s": 0.8, "settle_s": 1.5, "allocations": ["static"]}
    run = flown("angle-step", "tsbs12", 1, plan, tmp_path / "r.mcap", {}).analysed()
    truth = truth_of_motion(run)
    found = [r for r in run.results if isinstance(r, Measured) and r.quantity.name == "settling_time"]
    assert len(found) == 2
    for r in found:
        at = interval(r.estimate)
        assert at.low <= truth[f"settling_time@{r.where}"] <= at.high, r.where
        assert 0.1 * r.estimate.value > at.U
