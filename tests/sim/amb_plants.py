"""AMB plants for the tests of the core and its reference."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from sim_backend.core import LEVITATE, LIFT, READY, DriveLaw
from sim_backend.machines.amb5dof.params import AmbControl, AmbParams, unbalance
from sim_backend.machines.amb5dof.plant import CHANNELS, AmbPlant

Array = npt.NDArray[np.float64]
RPM = math.pi / 30
COLUMN = {name: k for k, name in enumerate(CHANNELS)}
DRIVE = DriveLaw(gain=0.02, limit=0.2, ramp=2000 * RPM)


def quiet(**changes: Any) -> AmbParams:
    """The nominal machine without noise and quantisation."""
    silent = {"position_noise": 0.0, "current_noise": 0.0, "position_lsb": 0.0, "current_lsb": 0.0}
    return dataclasses.replace(AmbParams(), **silent | changes)


def levitated(law: int, *, e: float = 10e-6, control: dict[str, float] | None = None, **changes: Any) -> AmbPlant:
    """A plant that has been lifted and holds its shaft at rest; noise as the nominal machine has it."""
    params = dataclasses.replace(AmbParams(), **{"unbalance": unbalance(e)} | changes)
    plant = AmbPlant(params, 1, control=AmbControl(**{"law": float(law)} | (control or {})))
    plant.mode = READY
    plant.run(1000)
    plant.mode = LIFT
    plant.run(5500)
    assert plant.moved
    plant.mode = LEVITATE
    plant.run(2000)
    assert plant.trips == 0
    return plant


def spun(plant: AmbPlant, rpm: float, settle_s: float = 0.5) -> AmbPlant:
    """The same plant, turning at `rpm`: set there in an instant, held by the drive."""
    s = plant.state()["s"]
    s[11] = rpm * RPM
    plant.set_state(s)
    plant.drive(None)
    plant.drive(DRIVE, rpm * RPM)
    plant.run(round(settle_s * 1e4))
    return plant


def synchronous(trace: Array, columns: slice | list[int]) -> Array:
    """Complex amplitudes of columns of a trace at its own mean speed, x = Re(a e^(j angle))."""
    angle = trace[:, 28]
    whole = np.searchsorted(angle, angle[0] + 2 * math.pi * np.floor((angle[-1] - angle[0]) / (2 * math.pi)))
    part = trace[:whole]
    return np.asarray(2 * (part[:, columns] * np.exp(-1j * part[:, 28:29])).mean(axis=0))
