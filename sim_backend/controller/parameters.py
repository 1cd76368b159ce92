"""The simulated controller's parameters: ranges, values in force, and where they act."""

from __future__ import annotations

import math

import numpy as np

from bench.rigfile import RigFile
from sim_backend.machine import SimulatedPlant, Truth

INTERFACE = ("watchdog_s", "landing_speed", "speed_ref")  # the interface's own; speed_ref acts on SPIN


class Parameters:
    """The rig file's parameters in the device, as they are after power-on: every default, and it acts.

    Attributes:
        values: in force, by name.
    """

    def __init__(self, rig: RigFile, truth: Truth, plant: SimulatedPlant) -> None:
        self._truth, self._plant = truth, plant
        self._by_index = {p.index: (name, p) for name, p in rig.parameters.items()}
        self.values = {name: p.default for name, p in self._by_index.values()}
        for name, value in self.values.items():
            self._apply(name, value)

    def read(self, index: int) -> tuple[str, float]:
        """Status and value in force."""
        if index not in self._by_index:
            return "UNKNOWN", 0.0
        return "OK", self.values[self._by_index[index][0]]

    def write(self, index: int, value: float, owner: bool, resting: bool) -> tuple[str, float]:
        """Status, and the value in force after it; `owner`: who writes owns the controller, `resting`: it holds no rotor."""
        if index not in self._by_index:
            return "UNKNOWN", 0.0
        name, p = self._by_index[index]
        if not owner:
            status = "WRONG_SESSION"
        elif not _within(value, p.low, p.high):
            status = "OUT_OF_RANGE"
        elif p.when == "resting" and not resting:
            status = "WRONG_STATE"
        else:
            status = "OK"
            self.values[name] = value
            self._apply(name, value)
        return status, self.values[name]

    def _apply(self, name: str, value: float) -> None:
        if name in INTERFACE:
            return
        defects = self._truth.defects
        if name in self._truth.machine.integral_gains:
            value *= defects["integrator_factor"]
        self._plant.set(name, value * defects.get(f"factor_{name}", 1.0))


def _within(value: float, low: float, high: float) -> bool:
    """Inside the range; its limits count, as they are in single precision too."""
    if not math.isfinite(value):
        return False
    return low <= round(value, 12) <= high or bool(np.isclose(value, (low, high), rtol=1e-6).any())
