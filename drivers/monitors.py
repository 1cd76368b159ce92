"""The power supply and the thermal monitor on registers."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from bench import units
from bench.rigfile.protection import AMBIENT
from drivers.registerdevice import RegisterDevice

Latest = Callable[[str], Mapping[str, float]]


class FieldSupply:
    """A `bench.procedure.roles.Supply` from the last poll. Registers: voltage, current, state."""

    def __init__(self, device: RegisterDevice, latest: Latest) -> None:
        """Raises ConfigError: the rig file does not state the registers."""
        self._name, self._latest = device.name, latest
        device.require("voltage", "current", "state")

    @property
    def voltage_V(self) -> float:
        return self._latest(self._name)["voltage"]

    @property
    def current_A(self) -> float:
        return self._latest(self._name)["current"]

    @property
    def on(self) -> bool:
        return bool(self._latest(self._name)["state"])


class FieldThermal:
    """A `bench.procedure.roles.Thermal` from the last poll. Registers: ambient; every other temperature is a winding's."""

    def __init__(self, device: RegisterDevice, latest: Latest) -> None:
        """Raises ConfigError: the rig file does not state the registers."""
        self._name, self._latest = device.name, latest
        device.require(AMBIENT)
        registers = device.spec.registers
        self._windings = [n for n, r in registers.items() if n != AMBIENT and units.unit(r.unit).si == "K"]

    @property
    def temperatures_K(self) -> Mapping[str, float]:
        latest = self._latest(self._name)
        return {name: latest[name] for name in self._windings}

    @property
    def ambient_K(self) -> float:
        return self._latest(self._name)[AMBIENT]
