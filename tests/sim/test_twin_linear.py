"""The twin's linear model against the twin itself, in small motions."""

from __future__ import annotations

import numpy as np
import pytest
from twin_rigs import SPINDLE, STAND, THREES, levitated, nominal, rig, shipped

from sim_backend.machines.twin.linear import Loop, free_motions, loop, matrix, slowest
from sim_backend.machines.twin.params import TwinParams
from sim_backend.machines.twin.quantities import offsets

BENT = "[simulation]\nmode_1_on = 1\nmode_1 = 900.0\nmagnetic_offset_yl = 1e-5"
RIGS = {
    "shipped": shipped(),
    "spindle": rig("spindle", SPINDLE),
    "threes": rig("threes", THREES),
    "with a notch": rig("notched", (*STAND, BENT)),
}


def of(p: TwinParams) -> Loop:
    n, c = p.radial, p.control
    gains = {key: np.array(getattr(c, key)) for key in ("kp", "ki", "kd")}
    return loop(p, np.array(c.bias[:n]), gains, np.array(offsets(p)[:n]))


@pytest.mark.parametrize("name", RIGS)
def test_small_motions_are_the_matrix(name: str) -> None:
    """Two that begin 0.1 um and some apart, 20 ms long; the bending itself is not in the matrix, the notch filter is."""
    t = nominal(RIGS[name])
    plant = levitated(t, 3.0)
    beside = plant.twin()
    state, away = plant.state()["s"], np.zeros(20)
    away[1:5] = 1e-7, -5e-8, 3e-7, 4e-7
    plant.set_state(state + away)
    step, basis = matrix(t.plant, of(t.plant)), free_motions(t.plant)
    x = np.zeros(len(step))
    x[: basis.shape[1]] = np.linalg.pinv(basis) @ away[1:5]
    found, expected = [], []
    for _ in range(200):
        plant.run(1)
        beside.run(1)
        x = step @ x
        found.append((plant.state()["s"] - beside.state()["s"])[1:5])
        expected.append(basis @ x[: basis.shape[1]])
    worst = np.abs(np.array(found) - expected).max(axis=0) / np.abs(expected).max(axis=0)
    assert worst.max() < (0.05 if name == "with a notch" else 2e-3)


def test_frequency_and_damping_are_of_the_slowest_mode() -> None:
    """The spindle's loops were laid out for w with a damping of 0.6, which delay takes some of."""
    t = nominal(RIGS["spindle"])
    hz, damping = slowest(t.plant, of(t.plant))
    assert (t.quantities["frequency"], t.quantities["damping"]) == (hz, damping)
    assert 50 < hz < 150
    assert 0.3 < damping < 0.7
