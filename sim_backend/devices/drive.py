"""The simulated drive: a speed-controlled motor on the shaft that obeys commands and looks after itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from bench.errors import ConfigError
from bench.rigfile import Device
from sim_backend.core import DriveLaw
from sim_backend.machine import SimulatedPlant, Truth

FAULTS = {"OVERSPEED": 1, "OVERLOAD": 2, "COMMUNICATION": 3, "EXTERNAL": 4}  # codes where the rig file names none
LAW = ("drive_gain", "drive_limit", "drive_ramp")
SILENT_S = 1.0  # without a request for so long it coasts
OVERLOAD_S = 5.0  # at its torque limit
STANDSTILL_RAD_S = 0.2
OVERSPEED = 1.1  # of the rig's greatest speed


class SimulatedDrive:
    """States: off, running (holds the target speed), stopping (brakes, then off). A fault is latched and switches off.

    Args:
        plant: what it turns.
        spec: the rig file's names of its faults.
        truth: its gain, torque limit and ramp; the planted fault.
        max_speed_rad_s: the rig's greatest speed.

    Raises:
        ConfigError: the rig file's simulation table lacks a value of the drive.
    """

    def __init__(self, plant: SimulatedPlant, spec: Device, truth: Truth, max_speed_rad_s: float) -> None:
        self._plant, self._max = plant, max_speed_rad_s
        missing = [name for name in LAW if name not in truth.values]
        if missing:
            raise ConfigError(f"simulation: found no {', '.join(missing)}; a simulated drive needs {', '.join(LAW)}")
        self._law = DriveLaw(*(truth.values[name] for name in LAW))
        self._codes = FAULTS | {name: int(code) for code, name in spec.faults.items() if code.isdecimal()}
        self.state, self.fault = "off", ""
        self._target, self._ramp = 0.0, self._law.ramp
        self._asked = self._below_limit = plant.tick
        self._planted_s = truth.defects["drive_fault_after_s"]

    def values(self) -> Mapping[str, float]:
        """What it measures, SI by register."""
        return {
            "running": float(self.state != "off"),
            "fault": float(self._codes[self.fault]) if self.fault else 0.0,
            "actual_speed": self._plant.shaft_speed,
            "torque": self._plant.drive_torque,
        }

    def asked(self) -> None:
        """A request has come: the host is there. It was not if this one comes too late."""
        self.follow()
        self._asked = self._plant.tick

    def accelerate(self, rad_s2: float) -> bool:
        """How fast the speed goes to its target; 0: as fast as it does by itself. False: it cannot be so fast."""
        if rad_s2 > self._law.ramp:
            return False
        self._ramp = rad_s2 or self._law.ramp
        if self.state == "running":
            self._plant.drive(replace(self._law, ramp=self._ramp), self._target)
        return True

    def aim(self, rad_s: float) -> None:
        """The speed to hold while it runs."""
        self._target = rad_s
        if self.state == "running":
            self._plant.drive(replace(self._law, ramp=self._ramp), rad_s)

    def obey(self, command: str) -> None:
        """Carry out a command; in fault it only resets and coasts."""
        if command == "coast":
            self._off()
        elif command == "reset" and self.state == "off":
            self.fault = ""
        elif command in ("run", "stop") and not self.fault:
            if command == "stop" and self.state == "off" and abs(self._plant.shaft_speed) < STANDSTILL_RAD_S:
                return
            self.state = "running" if command == "run" else "stopping"
            self._below_limit = self._plant.tick
            if command == "run":
                self._plant.drive(replace(self._law, ramp=self._ramp), self._target)
            else:
                self._plant.drive(self._law, 0.0)

    def follow(self) -> None:
        """What it does by itself: ends braking, and trips."""
        plant = self._plant
        elapsed = plant.tick * plant.tick_s
        if self._planted_s and elapsed > self._planted_s:
            self._planted_s = 0.0
            self._trip("EXTERNAL")
        if self.state == "off":
            return
        if abs(plant.drive_torque) < 0.999 * self._law.limit:
            self._below_limit = plant.tick
        if (plant.tick - self._asked) * plant.tick_s > SILENT_S:
            self._trip("COMMUNICATION")
        elif abs(plant.shaft_speed) > OVERSPEED * self._max:
            self._trip("OVERSPEED")
        elif (plant.tick - self._below_limit) * plant.tick_s > OVERLOAD_S:
            self._trip("OVERLOAD")
        elif self.state == "stopping" and abs(plant.shaft_speed) < STANDSTILL_RAD_S:
            self._off()

    def _trip(self, fault: str) -> None:
        self.fault = self.fault or fault
        self._off()

    def _off(self) -> None:
        self.state = "off"
        self._plant.drive(None)
