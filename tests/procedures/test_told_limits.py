"""Messages of plans and runs that leave no room: which limits meet, and what the reader can do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.rigfile import RigFile, load_rig
from bench.units import RPM
from procedures.run_up.procedure import late
from procedures.run_up.procedure import procedure as run_up
from procedures.sensitivity.procedure import procedure as sensitivity
from procedures.spindown import coasts
from procedures.spindown.plan import Plan as Spindown
from procedures.synchronous import fitting

STRANGERS = Path(__file__).parents[1] / "strangers"
SPINDLE = Path(__file__).parents[2] / "examples" / "vertical-spindle" / "spindle.toml"


def slow(rig: RigFile, speeds: tuple[float, ...], rad_s: float = 300 / RPM) -> str:
    return "; ".join(fitting.of_slow_roll(rig, rad_s, 10.0, speeds))


def with_parameter(rig: RigFile, name: str, value: float) -> RigFile:
    found = rig.parameters[name].model_copy(update={"default": value})
    return rig.model_copy(update={"parameters": {**rig.parameters, name: found}})


def test_a_slow_roll_that_fits_nowhere_names_both_limits_and_the_ways_out() -> None:
    stand, spindle = load_rig("amb5dof"), load_rig(SPINDLE)
    told = slow(stand, (600 / RPM, 3000 / RPM))
    assert "it takes 143 r/min or more" in told
    assert "no more than 90 r/min, 15% of the lowest of speeds_rad_s, 600 r/min" in told
    assert "speeds_rad_s from 955 r/min on" in told
    assert "slow_rad_s = 0: none" in told
    assert slow(stand, (600 / RPM, 3000 / RPM), 0.0) == ""
    assert slow(stand, (960 / RPM, 3000 / RPM), 15.0) == ""  # what it says helps
    assert "the bearings' force constants (capabilities.model" in slow(spindle, (600 / RPM, 3000 / RPM))


def test_a_soft_loop_that_leaves_no_slow_roll_is_named() -> None:
    rig = load_rig("amb5dof")
    for flat in rig.capabilities.flatness.values():
        rig = with_parameter(rig, flat.k1, 80.0**2)
    told = slow(rig, (1000 / RPM, 3000 / RPM))
    assert "no more than 115 r/min, 15% of the loop's own 764 r/min" in told
    assert "capabilities.flatness" in told
    assert "speeds_rad_s from" not in told  # that would not help


def test_a_landing_speed_above_all_that_is_allowed_is_named() -> None:
    rig = load_rig("amb5dof")
    rig = with_parameter(rig, rig.capabilities.landing_speed, 0.6 * rig.envelope.max_speed_rad_s)
    (told,) = fitting.of_speeds(rig, (100.0, 200.0))
    assert "no speed fits" in told
    assert "capabilities.landing_speed" in told
    assert "envelope.max_speed_rad_s" in told
    assert any("no speed fits" in x for x in run_up.problems(rig, run_up.plan(**rig.plans.get("run-up", {}))))


def test_reversed_speeds_are_told_as_such() -> None:
    """They were "above 0 r/min, twice the landing speed" on a rig that tells no landing speed."""
    bare, told = load_rig(str(STRANGERS / "lento.toml")), load_rig("amb5dof")
    assert [*fitting.of_speeds(bare, (-210.0, 405.0))] == [
        "speeds_rad_s: found -2005 r/min; expected speeds in the shaft's own sense, above 0 r/min"
    ]
    assert [*fitting.of_speeds(bare, (0.0, 405.0, 405.0))] == [
        "speeds_rad_s: found 0 r/min; expected above 0 r/min", "speeds_rad_s: expected each once",
    ]  # fmt: skip
    assert [*fitting.of_speeds(told, (1.0, 405.0))] == [
        "speeds_rad_s: found 10 r/min; expected above 382 r/min, twice the landing speed"
    ]
    assert [*fitting.of_slow_roll(bare, 16.0, 10.0, (-210.0, 405.0))] == []
    reversed_ = [x for x in sensitivity.problems(told, sensitivity.plan(speeds_rad_s=(-210.0,))) if "speeds" in x]
    assert reversed_ == ["speeds_rad_s: found -2005 r/min; expected speeds in the shaft's own sense, 0 r/min or above"]


def test_a_run_down_of_too_few_edges_says_from_which_speed_it_would_have_enough(tmp_path: Path) -> None:
    plan: dict[str, Any] = {"speed_rad_s": 60.0, "end_speed_rad_s": 50.0, "repeats": 2}
    run = simulated_run("spindown", str(SPINDLE), 0, plan, tmp_path / "recording.mcap")
    (told,) = [f for f in run.results if isinstance(f, Finding) and f.effect is Effect.ERROR]
    assert told.code == "run-down-short"
    assert "edges from" in told.text
    assert "400 or more" in told.text
    assert "coast_s" in told.text


@pytest.mark.parametrize(
    ("ends", "reached", "told"),
    [
        ((60.0, 5.0), True, "Start it faster: speed_rad_s = 173 or more"),  # 5 + 55 * 400 / 131
        ((60.0, 20.0), False, "It was cut off by coast_s = 15 s: give it 46 s at least"),
        ((600.0, 5.0), True, "By one edge a turn the drag of this shaft cannot be told"),
    ],
)
def test_what_a_short_run_down_lacks(ends: tuple[float, float], reached: bool, told: str) -> None:
    assert told in coasts.lacking(131, ends, Spindown(), load_rig(SPINDLE), reached=reached)


def test_a_passage_that_takes_too_long_says_what_to_set() -> None:
    coasting, ramped = late(240.0, 97.8, 0.0), late(60.0, 97.8, 20.0)
    assert "turns at 934 r/min" in coasting
    assert "bottom_rad_s above 98 rad/s" in coasting
    assert "deceleration_rad_s2" in coasting
    assert "its ramp of 20 rad/s^2: ramp more slowly" in ramped
