"""Plants for the tests of the core and its reference."""

from __future__ import annotations

import dataclasses
from typing import Any

from sim_backend.core import LEVITATE, LIFT, READY
from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.plant import Plant

NONE4, NONE8 = (0.0,) * 4, (0.0,) * 8


def quiet(**changes: Any) -> PlantParams:
    """The nominal machine without noise and quantisation."""
    silent = {
        "position_noise": 0.0,
        "current_noise": 0.0,
        "position_lsb": 0.0,
        "current_lsb": 0.0,
        "encoder_counts": 0.0,
    }
    return dataclasses.replace(PlantParams(), **silent | changes)


def centred(**changes: Any) -> PlantParams:
    """A quiet machine without tilt, offsets, runout, unbalance and hysteresis."""
    perfect = {
        "tilt": 0.0,
        "eccentricity": 0.0,
        "offset_x": (0.0, 0.0),
        "offset_y": (0.0, 0.0),
        "runout": NONE8,
        "target": NONE8,
        "motor_x": 0.0,
        "motor_y": 0.0,
        "hysteresis": 0.0,
    }
    return quiet(**perfect | changes)


def floating(**changes: Any) -> PlantParams:
    """A centred machine on which nothing acts but what a test switches on."""
    free = {"gravity": 0.0, "alpha_x": 0.0, "viscous": 0.0, "coulomb": 0.0, "detent": 0.0}
    return centred(**free | changes)


def levitated(params: PlantParams, seed: int = 1, control: ControlParams | None = None) -> Plant:
    """A plant that has been lifted and holds its rotor."""
    plant = Plant(params, seed, control=control)
    plant.mode = READY
    plant.run(1000)
    plant.mode = LIFT
    plant.run(12000)
    assert plant.moved
    plant.mode = LEVITATE
    plant.run(8000)
    assert plant.trips == 0
    return plant
