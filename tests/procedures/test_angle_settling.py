"""Few steps, encoders of other counts, and where a rotor ends: what an angle step makes of them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import flown
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.uncertainty import interval
from procedures.angle_step.course import Course
from procedures.angle_step.settling import Settling, jumps, settled
from procedures.servomotor.encoder import count_of, of_counts

COUNT = 2 * math.pi / 4096
PLAN = {
    "standstill_s": 0.3,
    "record_s": 0.8,
    "settle_s": 1.5,
    "steps_rad": [0.1],
    "allocations": ["static"],
    "repeats": 2,
}


def test_noise_of_two_steps_takes_no_swing_for_the_trembling_at_the_end() -> None:
    """A trend of half a count between two steps is noise of 6.3 times as much at the end of t with two degrees of freedom: the
    angle would be outside its band of 2.7 counts for good, and settled 4 to 10 ms later in the mean."""
    t = np.arange(4000) * 1e-4
    swing = 40 * np.exp(-t / 0.045) * np.cos(2 * np.pi * t / 0.1)
    y = 136 * COUNT - COUNT * (swing + 0.6 * np.sign(np.sin(2 * np.pi * t / 0.02)) * (t > 0.2))
    of = [Settling(way, Course(t, y, 87.0), 136 * COUNT, 2.73 * COUNT, 0.0) for way in (True, False) for _ in range(2)]
    found = settled("here", of, (0.45 * COUNT, 2), 0.002, COUNT)
    assert found.value == pytest.approx(of[0].time, abs=3e-3)
    assert found.u < 10e-3
    assert not jumps(of, (0.01 * COUNT, 2), 0.002, COUNT)


@pytest.mark.parametrize("counts", [2048, 8192])
def test_an_encoder_of_other_counts_than_the_plan_says_is_told(tmp_path: Path, counts: int) -> None:
    """By 2048 counts settling times were 30 ms short and overshoots 7 U off, with notes alone."""
    told = flown("angle-step", "tsbs12", 1, {**PLAN, "encoder_counts": counts}, tmp_path / "r.mcap", {}).analysed()
    found = [r for r in told.results if isinstance(r, Finding) and r.effect is Effect.ERROR]
    assert [f.code for f in found] == ["encoder-counts"]
    assert "4096 counts a turn" in found[0].text


def test_counts_by_angles_that_pass_many_of_them_at_once() -> None:
    """3.4 counts a tick: no two readings in a row are a count apart, and those of several turns are."""
    angle = (np.floor(3.4 * np.arange(9000) + 0.3) * COUNT + np.pi) % (2 * np.pi) - np.pi
    told = angle.astype(np.float32).astype(np.float64)
    assert count_of([told]) == (pytest.approx(COUNT, rel=1e-3), True)
    assert list(of_counts([told], 4096)) == []
    assert math.isnan(count_of([told[:3]])[0])


def test_an_angle_without_counts_takes_any_that_are_fine_enough() -> None:
    """Of an interpolated encoder: by 4096 counts there would be no edges to read between."""
    smooth = np.sort(np.random.default_rng(4).uniform(0.0, 0.2, 4000))
    (found,) = of_counts([smooth], 4096)
    assert "shows no counts" in found.text
    assert list(of_counts([smooth], int(found.text.split("give ")[1].split()[0]))) == []


def test_how_far_a_rotor_ends_beyond_its_reference_is_told_in_the_direction_of_the_step(tmp_path: Path) -> None:
    """Its integrator leaves it most of a count on, both ways: as angle less reference the ways had nearly cancelled."""
    plan = {**PLAN, "steps_rad": [math.radians(12)]}
    done = flown("angle-step", "tsbs12", 1, plan, tmp_path / "r.mcap", {}).analysed()
    found = {r.quantity.name: r.estimate for r in done.results if isinstance(r, Measured)}["final_error"]
    true = next(v for k, v in truth_of_motion(done).items() if k.startswith("final_error@"))
    assert true > 0.4 * COUNT
    assert abs(found.value - true) < interval(found).U
