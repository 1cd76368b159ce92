"""What the truth of set-point steps says of small motions: of the machine as it runs, with the noise of its sensors."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bench.rigfile import load_rig
from sim_backend import amb_step
from sim_backend.core.amb import CAC, CCS, AmbPlant
from sim_backend.truth import draw


def test_a_twin_goes_on_as_its_plant_does_and_leaves_it_alone() -> None:
    plant = amb_step.floating(AmbPlant().params, {"law": 0.0}, settle_s=0.1, noise=3)
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
    noisy = amb_step.unrounded(draw(rig, 5001).plant)
    deaf = dataclasses.replace(noisy, position_noise=0.0, current_noise=0.0)
    hz = [amb_step.small(amb_step.floating(p, settings, settle_s=2.0, noise=1), settings, "y").frequency
          for p in (noisy, deaf)]  # fmt: skip
    assert low < hz[0] / hz[1] - 1 < high
