"""The simulator's truth of a step of the angle: as long as it swings, as the run's own times are, and not rounded to ticks."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, flown
from bench.procedure import Measured
from sim_backend.machines.tsbs.truth_angle import _response
from sim_backend.motion import AngleAsked, AngleCase

PLAN = {"repeats": 2, "standstill_s": 0.3, "record_s": 0.8, "settle_s": 1.5, "allocations": ["priority"]}
LARGE = "priority, 12°, 200 Hz"


def settled(run: Simulated) -> float:
    """By the run, s."""
    return next(r.estimate.value for r in run.results if isinstance(r, Measured)
                and r.quantity.name == "settling_time" and r.where == LARGE)  # fmt: skip


def test_a_swing_that_goes_on_is_looked_at_to_its_end(tmp_path: Path) -> None:
    """With half of the damping 12 degrees swing for 0.34 s: what was looked at closely ended after 0.3 s."""
    run = flown("angle-step", "tsbs12", 1, PLAN, tmp_path / "r.mcap", {"factor_kd_theta": 0.5}).analysed()
    true = truth_of_motion(run)[f"settling_time@{LARGE}"]
    assert true > 0.33
    assert settled(run) == pytest.approx(true, abs=3e-3)


def test_the_truth_takes_its_times_from_the_run(tmp_path: Path) -> None:
    """Each write takes a while, and the motor takes the load by its slew: the angle's integrator learns meanwhile."""
    run = flown("angle-step", "tsbs12", 1, {**PLAN, "steps_rad": [0.1]}, tmp_path / "r.mcap", {}).analysed()
    asked: list[AngleAsked] = []
    motions = dataclasses.replace(run.drawn.machine.motions, angle=lambda rig, drawn, of: asked.append(of) or {})
    machine = dataclasses.replace(run.drawn.machine, motions=motions)
    truth_of_motion(dataclasses.replace(run, drawn=dataclasses.replace(run.drawn, machine=machine)))
    assert asked[0].standstill_s == pytest.approx(0.31)
    assert asked[0].record_s == pytest.approx(0.81)
    assert asked[0].settle_s == pytest.approx(2.0)


def test_a_rise_is_known_to_less_than_a_tick() -> None:
    t = np.arange(3000.0)
    for rate in (0.00123, 0.00124, 0.00125):
        found = dict(_response(np.minimum(rate * t, 1.0), 0, AngleCase({}, 1.0, 0.02, False)))
        assert found["rise_time"] == pytest.approx(0.8 / rate * 1e-4, rel=1e-6)


def test_no_step_depends_on_where_the_hand_over_has_left_the_rotor(tmp_path: Path) -> None:
    """On this machine it is left a count from where steps leave it: the first one's rise was 0.7 ms longer than the truth's,
    that of the mean 70 us."""
    run = flown("angle-step", "tsbs12", 20, {**PLAN, "allocations": ["static"], "steps_rad": [np.radians(2)]},
                tmp_path / "r.mcap", {}).analysed()  # fmt: skip
    truth = truth_of_motion(run)
    found = {f"{r.quantity.name}@{r.where}": r.estimate.value for r in run.results if isinstance(r, Measured)}
    where = "static, 2°, 200 Hz"
    assert found[f"rise_time@{where}"] == pytest.approx(truth[f"rise_time@{where}"], abs=60e-6)
    assert found[f"overshoot@{where}"] == pytest.approx(truth[f"overshoot@{where}"], abs=4e-3)
