"""The true sensitivity of a twin's loops at standstill, with the controller as the rig file sets it, by its linear model."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.machines.twin import linear
from sim_backend.machines.twin.layout import layout_of
from sim_backend.machines.twin.quantities import offsets


def sensitivity(rig: RigFile, plant: Any, axis: str, hz: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128]:
    """Of a radial axis at `hz` (m,): after over inject. With x' = M x + b u, u added to that axis' reference, and
    the reference the state j, it is z (z - M)^-1 b at j."""
    n, control = plant.radial, plant.control
    gains = {key: np.array(getattr(control, key))[:n] for key in ("kp", "ki", "kd")}
    model = linear.loop(plant, np.array(control.bias)[:n], gains, np.array(offsets(plant))[:n])
    matrix = linear.matrix(plant, model)
    j = 2 * linear.free_motions(plant).shape[1] + n + [a.name for a in layout_of(rig).radial].index(axis)
    unit = np.eye(len(matrix))
    turned = np.exp(2j * np.pi * hz * plant.tick)
    return np.array([z * np.linalg.solve(z * unit - matrix, unit[j])[j] for z in turned])
