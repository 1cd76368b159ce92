"""Linear-rotary actuators for the tests: flying, clamped, with tolerances; responses of their loops."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sim_backend.core.plant import Array
from sim_backend.machines.lira.params import ControlParams, PlantParams
from sim_backend.machines.lira.plant import TICKS_S, TRACE, Plant, ideal

RADIAL = [TRACE.index(f"true_{n}") for n in ("x1", "x2", "y1", "y2")]


def column(rows: Array, name: str) -> Array:
    """One column of a trace."""
    return rows[:, TRACE.index(name)]


def flying(params: PlantParams | None = None, *, reduced: bool = False, z: float = 11e-3, **control: float) -> Plant:
    """All loops closed at rest at z, without rings."""
    p = replace(params or ideal(), clearance=1.0, clearance_out=1.0)
    plant = Plant(p, control=ControlParams(**control), reduced=reduced)
    plant.put(z=z)
    plant.refer("z", z)
    plant.switch(currents=True, bearings=True, axial=True, angle=True)
    return plant


def current_step(params: PlantParams | None = None, amperes: float = 3.0, every: int = 1) -> Array:
    """L's figure 6: the mover clamped, 200 V, a step of d in R1; rows from the step on."""
    plant = Plant(replace(params or ideal(), locked=1.0, supply=200.0))
    plant.switch(currents=True)
    plant.run(1e-3)
    plant.step("d_R1", amperes)
    return plant.run(3e-3, every)


def rise_s(rows: Array, amperes: float = 3.0, every: int = 1) -> float:
    """From 10 to 90 % of a step of d in R1."""
    y = column(rows, "i_d_R1")
    t = np.arange(len(y)) * every / TICKS_S
    first = [int(np.argmax(y >= share * amperes)) for share in (0.1, 0.9)]
    at = [
        np.interp(share * amperes, y[k - 1 : k + 1], t[k - 1 : k + 1])
        for share, k in zip((0.1, 0.9), first, strict=True)
    ]
    return float(at[1] - at[0])


def response(axis: str, hz: float, amplitude: float, params: PlantParams | None = None, **control: float) -> complex:
    """y/r of a position loop with the reference and its rate injected."""
    number: dict[str, Any] = {"x1": 0, "z": 4, "angle": 5}
    plant = flying(params, inject_axis=number[axis], inject_amplitude=amplitude, inject_hz=hz, **control)
    plant.run(max(0.06, 4 / hz))
    rows = plant.run(max(3, np.ceil(0.03 * hz)) / hz)
    y, r = column(rows, f"true_{axis}"), column(rows, "injected")
    turn = np.exp(-2j * np.pi * hz * np.arange(len(y)) * 8 / TICKS_S)
    return complex(((y - y.mean()) @ turn) / (r @ turn))


def corner_hz(axis: str, amplitude: float, low: float, high: float, **control: float) -> float:
    """Where |y/r| falls to -3 dB, between two frequencies of which the first is below it."""
    for _ in range(12):
        middle = (low * high) ** 0.5
        if abs(response(axis, middle, amplitude, **control)) > 0.5**0.5:
            low = middle
        else:
            high = middle
    return (low * high) ** 0.5
