"""The truth of a run at the torque limit: what is taken of the readings of a rotor that turns unevenly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.rigfile import RigFile, load_rig
from sim_backend.core.plant import TICK_S
from sim_backend.machines.tsbs.truth_speed import over_turns
from sim_backend.motion import SpeedsAsked
from sim_backend.truth import draw, nominal


@pytest.mark.parametrize("seconds", [8.0, 8.03, 8.07, 8.11])
def test_a_part_of_a_turn_changes_neither_speed_nor_bound(seconds: float) -> None:
    """w = 43 + 0.3 cos(angle): sqrt(43^2 - 0.3^2) rad/s on average. A swing of the bound by 0.2 A along the turn would leave up
    to 0.2/(43 * 8) A, 6e-4, of a part of one, and the swing of the angle by 7 mrad up to 1.7e-3 rad/s."""
    angle = np.zeros(round(seconds / TICK_S))
    for k in range(1, len(angle)):
        angle[k] = angle[k - 1] + TICK_S * (43.0 + 0.3 * math.cos(angle[k - 1] + TICK_S * 21.5))
    count = 2 * math.pi / 4096
    speed, bound, ripple = over_turns(np.round((0.7 + angle) / count) * count, 4.0 + 0.2 * np.sin(angle))
    assert speed == pytest.approx(math.sqrt(43.0**2 - 0.3**2), abs=2e-5)
    assert bound == pytest.approx(4.0, abs=1e-3)
    assert ripple == pytest.approx(0.3 / math.sqrt(2), rel=0.02)


def test_counts_that_beat_with_a_millisecond_are_no_ripple() -> None:
    """At 43.01 counts a millisecond the rounding goes round once a turn: every tenth tick alone would show 46 mrad/s of a rotor
    that turns evenly."""
    count = 2 * math.pi / 4096
    angle = 2 * math.pi * 43000 / 4095 * TICK_S * np.arange(round(4.0 / TICK_S))
    assert over_turns(np.round(angle / count) * count, np.ones(len(angle)))[2] < 2e-3


def test_sensors_whose_scale_drifts_are_watched_as_they_are_when_the_run_is() -> None:
    """5e-4 a second for 100 s: of 8 A that the sensors read 7.62 A flow, all the while that the truth is watched."""
    rig = load_rig("tsbs12-drag")
    gains = {f"i_m{k}.gain": 1.05 * nominal(rig)[f"i_m{k}.gain"] for k in range(1, 5)}
    drifting, scaled = (_speed_of(rig, truth) for truth in ({"segment_scale_drift": 5e-4}, gains))
    assert drifting == pytest.approx(scaled, rel=1e-9)


def _speed_of(rig: RigFile, truth: dict[str, float]) -> float:
    """100 s after the sensors were right."""
    drawn = draw(rig, 3, {**nominal(rig), **truth})
    asked = SpeedsAsked(
        {name: p.default for name, p in rig.parameters.items()},
        [{"motor_share": 1.0, "allocation": 1.0, "segment_max": 8.0, "torque_limit_run": 1.0}],
        {"priority": {"allocation": 1.0}}, 100.0, 2.0, {1: 100.0, -1: 100.0},
    )  # fmt: skip
    assert drawn.machine.motions.speeds is not None
    return drawn.machine.motions.speeds(rig, drawn, asked)["priority"]["speed"]
