"""The simulated controller's states: what a command does in each, and what it does by itself (docs/reference/protocol.md)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sim_backend import core
from sim_backend.controller import setdown
from sim_backend.controller.ownership import Ownership
from sim_backend.controller.telemetry import Span
from sim_backend.machine import Machine, SimulatedPlant

SETTLED_M, SETTLED_S = 20e-6, 0.05
LIFT_TIMEOUT_S = 5.0
RESTING = ("OFF", "READY")
AT_REST = (*RESTING, "FAULT")
WITHOUT_CURRENT = ("OFF", "FAULT")
MOVING = ("LIFTING", "LANDING", "COASTING")
HELD = ("LEVITATED", "SPINNING")
TURNING = (*HELD, "COASTING")
ANY = (*AT_REST, *MOVING, *HELD)
OBEYED = {
    "IDENTIFY": ANY, "MAKE_SAFE": ANY, "RELEASE": WITHOUT_CURRENT, "CLEAR_FAULT": ("FAULT",), "ENABLE": ("OFF",),
    "DISABLE": RESTING, "LEVITATE": ("READY",), "LAND": ("LEVITATED",), "SPIN": HELD, "STOP": HELD,
}  # fmt: skip
"""In which states each command is."""


class States:
    """State and fault of a controller that has just been switched on. Its plant goes on as it is, without currents.

    Args:
        plant: what it holds and turns.
        machine: which kind it is.
        parameters: values in force, by name.
        owner: whose silence it watches.
        fault_after_s: a planted fault of a sensor, 0 for none.
    """

    def __init__(
        self,
        plant: SimulatedPlant,
        machine: Machine,
        parameters: Mapping[str, float],
        owner: Ownership,
        fault_after_s: float = 0.0,
    ) -> None:
        self._plant, self._machine, self._own, self._owner = plant, machine, parameters, owner
        self._planted_s = fault_after_s
        self.state, self.fault = "OFF", "NONE"
        self._since, self._steady = plant.tick, 0
        self._leaving = False  # MAKE_SAFE: OFF when the rotor has landed
        self._free = plant.tick  # from here on nothing drives a shaft that is to be landed
        plant.mode = core.OFF
        plant.clear_trips()
        self._brake()

    @property
    def resting(self) -> bool:
        """Whether it holds no rotor."""
        return self.state in RESTING

    @property
    def at_rest(self) -> bool:
        """Whether another host may take it over."""
        return self.state in AT_REST

    @property
    def stepwise(self) -> bool:
        """Whether a movement's end must be looked for every few periods."""
        return self.state in MOVING

    def begin(self) -> None:
        """Before time passes."""

    def spans(self, rows: core.Array, first_tick: int) -> list[Span]:
        """Rows of the plant, which ran in one state."""
        return [Span(rows, first_tick, self.state, self.fault, self._owner.heartbeat, self._owner.armed)]

    @property
    def watching(self) -> bool:
        """Whether a host that falls silent would be noticed."""
        return self._owner.armed and self.state not in WITHOUT_CURRENT

    def progress(self, rows: core.Array) -> None:
        """What it does by itself at the present, after `rows` of the plant: trips, watchdog, ends of movements."""
        plant, tick = self._plant, self._plant.tick
        planted = self._planted_s and tick * plant.tick_s > self._planted_s
        if plant.trips or (self.fault == "NONE" and (planted or (self.state in HELD and setdown.pulses_lost(plant)))):
            self.fail(next((name for bit, name in core.TRIPS.items() if plant.trips & bit), "SENSOR"))
        elif self.watching and (tick - self._owner.heartbeat) * plant.tick_s > self._own["watchdog_s"]:
            self._lose_host()
        if self.state == "LIFTING" and len(rows):
            self._lifting(rows)
        elif self.state == "LANDING":
            self._landing()
        elif self.state == "COASTING":
            self._coasting()
        elif self.state in HELD:
            turning = abs(plant.speed) > self._own["landing_speed"]
            self.state = "SPINNING" if turning else "LEVITATED"

    def _lifting(self, rows: core.Array) -> None:
        plant = self._plant
        still = bool((np.abs(rows[:, self._machine.radial]) < SETTLED_M).all()) and plant.moved
        self._steady = self._steady + len(rows) if still else 0
        if self._steady * plant.period_ticks * plant.tick_s >= SETTLED_S:
            plant.mode = core.LEVITATE
            self._enter("LEVITATED")
        elif (plant.tick - self._since) * plant.tick_s > self._patience_s:
            self.fail("LIFT_TIMEOUT")

    @property
    def _patience_s(self) -> float:
        """How long a lift may take: a plant may ask for more, where what lifts has to be turned on gradually."""
        more: float = getattr(self._plant, "lift_timeout_s", LIFT_TIMEOUT_S)
        return more + self._own["lift_time_s"]

    def _landing(self) -> None:
        plant = self._plant
        if setdown.too_fast(plant, self._own["landing_speed"]):
            plant.mode = core.LIFT
            self._enter("COASTING")
        elif plant.moved:
            if self.fault != "NONE":
                self._switch_off("FAULT")
            elif self._leaving:
                self._switch_off("OFF")
            else:
                plant.mode = core.READY
                self._enter("READY")

    def _coasting(self) -> None:
        plant = self._plant
        if plant.mode == core.LIFT and plant.moved:  # a landing was broken off
            plant.mode = core.LEVITATE
        if setdown.slow(plant, self._own["landing_speed"], self._free):
            self._land()

    def fail(self, fault: str) -> None:
        """Latch a fault, and set the rotor down as its kind asks for."""
        first = self.fault == "NONE"
        self.fault = fault if first else self.fault
        self._plant.clear_trips()
        if fault in ("OVERCURRENT", "OVERSPEED", "SENSOR") and self.state in TURNING:
            if first or self.state != "COASTING":  # a trip that comes again and again does not put the landing off
                self._safe()
        else:
            self._switch_off("FAULT")

    def _lose_host(self) -> None:
        self.fault = "HEARTBEAT_LOST" if self.fault == "NONE" else self.fault
        self._owner.armed = False
        self._safe()

    def _safe(self) -> None:
        """Coast while turning fast, then land; amplifiers off where the rotor rests already. Nobody says that the drive on
        the shaft is off."""
        if self.state in TURNING:
            self._let_down(setdown.DRIVE_GIVES_UP_S)
        elif self.state == "LIFTING":
            self._land()
        elif self.state in RESTING:
            self._switch_off("OFF" if self.fault == "NONE" else "FAULT")

    def _let_down(self, driven_s: float) -> None:
        """Land as soon as the shaft is slow; a drive may turn it for `driven_s` more."""
        self._torque(0.0)
        self._brake()
        self._free = self._plant.tick + round(driven_s / self._plant.tick_s)
        if setdown.slow(self._plant, self._own["landing_speed"], self._free):
            self._land()
        else:
            self._enter("COASTING")

    def _brake(self) -> None:
        """Aim at standstill, where the controller has a motor."""
        if self._machine.turns:
            self._plant.set("speed_ref", 0.0)

    def _torque(self, on: float) -> None:
        if self._machine.turns:
            self._plant.set("torque_on", on)

    def _switch_off(self, state: str) -> None:
        self._plant.mode = core.OFF
        self._owner.armed = False
        self._enter(state)

    def _land(self) -> None:
        self._plant.mode = core.LAND
        self._enter("LANDING")

    def _enter(self, state: str) -> None:
        self.state, self._since, self._steady = state, self._plant.tick, 0

    def obey(self, name: str) -> bool:
        """Carry out a command, or refuse it in this state."""
        plant = self._plant
        if self.state not in OBEYED.get(name, ()):
            return False
        match name:
            case "MAKE_SAFE":
                self._leaving = True
                self._safe()
            case "RELEASE":
                self._owner.release()
            case "CLEAR_FAULT":
                self.fault = "NONE"
                plant.clear_trips()
                self._enter("OFF")
            case "ENABLE":
                self._leaving = False
                self._owner.arm(plant.tick)
                plant.mode = core.READY
                self._enter("READY")
            case "DISABLE":
                self._switch_off("OFF")
            case "LEVITATE":
                self._torque(1.0)
                plant.mode = core.LIFT
                self._enter("LIFTING")
            case "LAND" if abs(plant.speed) > self._own["landing_speed"]:
                return False
            case "LAND":
                self._let_down(0.0)  # who asks for it has switched the drive off
            case "SPIN" if not self._machine.turns:
                return False
            case "SPIN":
                plant.set("speed_ref", self._own["speed_ref"])
            case "STOP":
                self._brake()
        return True
