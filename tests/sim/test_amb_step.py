"""What the truth of set-point steps says of small motions: of the machine as it runs, with the noise of its sensors."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bench.errors import AnalysisError
from bench.rigfile import load_rig
from sim_backend.core import TICK_S
from sim_backend.machines.amb5dof import truth_step
from sim_backend.machines.amb5dof.plant import CAC, CCS, AmbPlant
from sim_backend.truth import draw


def test_a_twin_goes_on_as_its_plant_does_and_leaves_it_alone() -> None:
    plant = truth_step.floating(AmbPlant().params, {"law": 0.0}, settle_s=0.1, noise=3)
    same, moved = plant.twin(), plant.twin()
    moved.set("ref_y", 1e-6)
    rows, other, own = same.run(300), moved.run(300), plant.run(300)
    assert np.array_equal(rows, own)
    assert not np.array_equal(other, own)
    assert plant.get("ref_y") == 0.0


@pytest.mark.parametrize(("law", "low", "high"), [(CCS, -0.0002, 0.0002), (CAC, 0.0003, 0.0009)], ids=["ccs", "cac"])
def test_noise_raises_the_frequency_of_cac_alone(law: int, low: float, high: float) -> None:
    """The amplifiers smooth a root of a noisy force: its slope grows by s^2/4, s the noise as a share of the force."""
    rig = load_rig("amb5dof")
    settings = {n: p.default for n, p in rig.parameters.items()} | {"law": float(law)}
    noisy = truth_step.unrounded(draw(rig, 5001).plant)
    deaf = dataclasses.replace(noisy, position_noise=0.0, current_noise=0.0)
    hz = [truth_step.small(truth_step.floating(p, settings, settle_s=2.0, noise=1), settings, "y").frequency
          for p in (noisy, deaf)]  # fmt: skip
    assert low < hz[0] / hz[1] - 1 < high


def test_a_shaft_that_turns_answers_with_its_own_unbalance() -> None:
    """By hand: the same steps at other angles of the shaft, as means over whole revolutions, each beside where it rested."""
    rig = load_rig("amb5dof")
    settings = {n: p.default for n, p in rig.parameters.items()} | {"law": float(CCS)}
    plant, turn, size = truth_step.quiet(draw(rig, 3).plant), 63, 20e-6
    speed = 2 * np.pi / (turn * TICK_S)
    _, shown = truth_step.truth(plant, settings, "z", [size], speed=speed, record_s=0.3)
    alone, found = truth_step.floating(plant, settings, speed), []
    for k in range(5):
        for begin, end in ((0.0, size), (size, 0.0), (0.0, -size), (-size, 0.0)):
            rest = alone.run(3000 + 11 * k, 1)[1][-40 * turn :]
            alone.set("ref_z", end)
            moved = alone.run(3000, 1)[1][1000 : 1000 + 20 * turn]
            rested, there = (truth_step.positions(plant, settings, x)[1].mean() for x in (rest, moved))
            found += [(there - rested) / size] if end > begin else []
    up = shown[size, 1].y
    assert up[1000 : 1000 + 20 * turn].mean() == pytest.approx(np.mean(found), abs=2e-4)
    assert np.ptp(up[-turn:]) < 2e-3  # the shaft whirls by a third of the step; none of it is left


def test_a_shaft_that_falls_shows_no_steps() -> None:
    """On rings 26 um away: it touches them while it steps, and its record ends there."""
    rig = load_rig("amb5dof")
    settings = {n: p.default for n, p in rig.parameters.items()} | {"law": float(CCS)}
    plant = truth_step.quiet(draw(rig, 18, {"geometry.clearance": 26e-6}).plant)
    with pytest.raises(AnalysisError, match="does not stay up"):
        truth_step.truth(plant, settings, "y", [20e-6], record_s=1.5)
