"""The simulated controller's parameters: ranges, values in force, and where they act."""

from __future__ import annotations

import copy
import math

import numpy as np

from bench.rigfile import RigFile
from sim_backend.controller.controls import OWN, controls
from sim_backend.machine import SimulatedPlant, Truth

INTERFACE = ("watchdog_s", "landing_speed", "speed_ref")  # the interface's own; speed_ref acts on SPIN


class Parameters:
    """The rig file's parameters in the device, as they are after power-on: every default, and it acts.

    Args:
        strict: whether every parameter must be a control of the plant (KeyError); else one that is none acts on nothing.

    Attributes:
        values: in force, by the rig file's names.
        own: the controls of the controller itself (`sim_backend.controller.controls.OWN`), set or not.
    """

    def __init__(self, rig: RigFile, truth: Truth, plant: SimulatedPlant, strict: bool = True) -> None:
        self._truth, self._plant, self._strict, self._parameters = truth, plant, strict, rig.parameters
        self._names = {p.index: name for name, p in rig.parameters.items() if p.index is not None}
        self._controls = controls(rig, truth.machine)
        self.own = {name: truth.values.get(name, value) for name, value in OWN.items()}
        if "lift_time_s" not in {c.name for chosen in self._controls.values() for c in chosen}:
            plant.set("lift_time_s", self.own["lift_time_s"])
        self.values = {name: p.default for name, p in rig.parameters.items()}
        for name, value in self.values.items():
            self._apply(name, value)

    def on(self, plant: SimulatedPlant) -> Parameters:
        """The same that act on another plant from now on, for truths that go two ways from one state."""
        other = copy.copy(self)
        other._plant, other.values, other.own = plant, dict(self.values), dict(self.own)
        return other

    def read(self, index: int) -> tuple[str, float]:
        """Status and value in force."""
        if index not in self._names:
            return "UNKNOWN", 0.0
        return "OK", self.values[self._names[index]]

    def write(self, index: int, value: float, owner: bool, resting: bool) -> tuple[str, float]:
        """Status, and the value in force after it; `owner`: who writes owns the controller, `resting`: it holds no rotor."""
        if index not in self._names:
            return "UNKNOWN", 0.0
        name = self._names[index]
        return self.set(name, value, owner, resting), self.values[name]

    def set(self, name: str, value: float, owner: bool, resting: bool) -> str:
        """Write a parameter by its name, if it may be; the status."""
        p = self._parameters[name]
        if not owner:
            return "WRONG_SESSION"
        if not _within(value, p.low, p.high):
            return "OUT_OF_RANGE"
        if p.when == "resting" and not resting:
            return "WRONG_STATE"
        self.values[name] = value
        self._apply(name, value)
        return "OK"

    def _apply(self, name: str, value: float) -> None:
        for control in self._controls.get(name, ()):
            acting = control.of(value)
            if control.name in OWN:
                self.own[control.name] = acting
            if control.name not in INTERFACE:
                self._act(name, control.name, acting)

    def _act(self, name: str, control: str, value: float) -> None:
        defects = self._truth.defects
        if control in self._truth.machine.integral_gains:
            value *= defects["integrator_factor"]
        try:
            self._plant.set(control, defects.get(f"kept_{name}") or value * defects.get(f"factor_{name}", 1.0))
        except KeyError:
            if self._strict:
                raise


def _within(value: float, low: float, high: float) -> bool:
    """Inside the range; its limits count, as they are in single precision too."""
    if not math.isfinite(value):
        return False
    return low <= round(value, 12) <= high or bool(np.isclose(value, (low, high), rtol=1e-6).any())
