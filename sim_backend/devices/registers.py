"""The register devices of a simulated rig: drive, supply and thermal monitor, whose registers follow the plant.

The bank belongs to one thread, the one that runs the plant. It is read in-process through `port`, and by what serves it
(`sim_backend.devices.modbus_server`) through `device`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from bench.clock import Clock
from bench.errors import ConfigError
from bench.rigfile import Device, RigFile
from bench.rigfile.registers import RANGES, Register, RegisterRefused, Table, Words
from sim_backend.controller.telemetry import AMBIENT_K, RISE_K, WARM_S
from sim_backend.core import LEVITATE
from sim_backend.devices.drive import SimulatedDrive
from sim_backend.machine import PLANTED_S, SimulatedPlant, Truth

ILLEGAL_ADDRESS, ILLEGAL_VALUE = 2, 3
IDLE_A = 0.35  # what the supply feeds besides the copper of the windings

Values = Mapping[str, float]


class RegisterBankDevice:
    """One device's registers, as the rig file maps them.

    Args:
        spec: its map.
        values: what its input registers, and holding registers that nobody writes, hold now; SI by name. Registers of
            other names do not exist.
        written: takes the writable registers that a write touched; False refuses their values.
        asked: told of every request, answered or not.
    """

    def __init__(
        self, name: str, spec: Device, values: Callable[[], Values], written: Callable[[Sequence[str]], bool],
        asked: Callable[[], None],
    ) -> None:  # fmt: skip
        self.name, self.spec = name, spec
        self._values, self._written, self._asked = values, written, asked
        self._kept = {n: r.raw_words(0, spec.word_order) for n, r in spec.registers.items() if r.writable}
        known = {*values(), *self._kept}
        self._place: dict[tuple[Table, int], tuple[str, int]] = {
            (r.table, r.address + k): (name, k)
            for name, r in spec.registers.items() if name in known for k in range(r.count)
        }  # fmt: skip

    def read(self, table: Table, address: int, count: int) -> Words:
        """Registers as words.

        Raises:
            RegisterRefused: one of them does not exist.
        """
        self._asked()
        places = self._places(table, address, count)
        held: dict[str, Words] = {}
        values: Values | None = None
        for name, _ in places:
            if name in held:
                continue
            if name in self._kept:
                held[name] = self._kept[name]
                continue
            values = values or self._values()
            held[name] = _words(self.spec.registers[name], values[name], self.spec)
        return tuple([held[name][k] for name, k in places])

    def write(self, address: int, words: Sequence[int]) -> None:
        """Write holding registers, and do what that means.

        Raises:
            RegisterRefused: one of them does not exist or cannot be written, or the device refuses the value; nothing
                was written.
        """
        self._asked()
        places = self._places("holding", address, len(words))
        if any(name not in self._kept for name, _ in places):
            raise self._refused(ILLEGAL_ADDRESS, "holding", address, len(words))
        before = dict(self._kept)
        for (name, k), word in zip(places, words, strict=True):
            held = self._kept[name]
            self._kept[name] = (*held[:k], word, *held[k + 1 :])
        if not self._written(tuple(dict.fromkeys(name for name, _ in places))):
            self._kept = before
            raise self._refused(ILLEGAL_VALUE, "holding", address, len(words))

    def kept(self, name: str) -> tuple[float, float]:
        """A writable register's raw value, and its value in SI.

        Raises:
            ValueError: it holds no finite number.
        """
        r, words, order = self.spec.registers[name], self._kept[name], self.spec.word_order
        return r.raw(words, order), r.value(words, order)

    def _places(self, table: Table, address: int, count: int) -> list[tuple[str, int]]:
        try:
            return [self._place[table, address + k] for k in range(count)]
        except KeyError:
            raise self._refused(ILLEGAL_ADDRESS, table, address, count) from None

    def _refused(self, code: int, table: Table, address: int, count: int) -> RegisterRefused:
        where = f"unit {self.spec.unit}, {table} registers {address} to {address + count - 1}"
        return RegisterRefused(code, f"link {self.spec.link}: {where}")


@dataclass(frozen=True)
class BankPort:
    """A `bench.rigfile.registers.RegisterPort` in this process."""

    device: RegisterBankDevice

    def read(self, table: Table, address: int, count: int) -> Words:
        return self.device.read(table, address, count)

    def write(self, address: int, words: Words) -> None:
        self.device.write(address, words)


class RegisterBank:
    """The register devices of a simulated rig.

    It is a service of a served rig without endpoints of its own; in-process `Followed` ticks it.

    Raises:
        ConfigError: two devices have one unit of a link.
    """

    def __init__(self, rig: RigFile, truth: Truth, plant: SimulatedPlant) -> None:
        self._plant = plant
        self._held_from: int | None = None
        self.drives: dict[str, SimulatedDrive] = {}
        self.devices: dict[str, RegisterBankDevice] = {}
        made = {"drive": self._drive, "supply": self._supply, "thermal": self._thermal}
        for name, spec in rig.devices.items():
            for role in (r for r in spec.roles if r in made):
                self.devices[name] = made[role](name, spec, rig, truth)
        self._units: dict[tuple[str, int], RegisterBankDevice] = {}
        for name, device in self.devices.items():
            other = self._units.setdefault((device.spec.link, device.spec.unit), device)
            if other is not device:
                raise ConfigError(
                    f"devices.{name}.unit: found {device.spec.unit}, which is {other.name}'s; expected one of its own"
                )

    def port(self, name: str) -> BankPort:
        """A device's port, in-process."""
        return BankPort(self.devices[name])

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the links on which there are devices."""
        return tuple(dict.fromkeys(link for link, _ in self._units))

    def device(self, link: str, unit: int) -> RegisterBankDevice | None:
        """The device with a unit number on a link, if there is one."""
        return self._units.get((link, unit))

    def on(self, link: str) -> tuple[RegisterBankDevice, ...]:
        """The devices of a link."""
        return tuple(d for d in self.devices.values() if d.spec.link == link)

    def start(self) -> tuple[str, ...]:
        """It has no endpoints of its own."""
        return ()

    def tick(self, now_ns: int) -> None:
        """Let the drive do what it does by itself. Time is the plant's."""
        for drive in self.drives.values():
            drive.follow()

    def stop(self) -> None:
        """Nothing to release."""

    def _drive(self, name: str, spec: Device, rig: RigFile, truth: Truth) -> RegisterBankDevice:
        drive = SimulatedDrive(self._plant, spec, truth, rig.envelope.max_speed_rad_s)
        self.drives[name] = drive
        values = self._told(name, drive.values, truth)
        device = RegisterBankDevice(name, spec, values, lambda names: _obeyed(device, drive, names), drive.asked)
        return device

    def _supply(self, name: str, spec: Device, rig: RigFile, truth: Truth) -> RegisterBankDevice:
        def values() -> Values:
            volts = truth.supply_V
            return {"voltage": volts, "current": IDLE_A + truth.machine.copper_W(self._plant) / volts, "state": 1.0}

        return RegisterBankDevice(name, spec, self._told(name, values, truth), lambda _: True, lambda: None)

    def _thermal(self, name: str, spec: Device, rig: RigFile, truth: Truth) -> RegisterBankDevice:
        def values() -> Values:  # as the telemetry's temperatures, controller/telemetry.py
            warm = AMBIENT_K + RISE_K * (1 - math.exp(-self._plant.tick * self._plant.tick_s / WARM_S))
            return {n: warm + above for n, above in truth.machine.windings.items()} | {"ambient": AMBIENT_K}

        return RegisterBankDevice(name, spec, self._told(name, values, truth), lambda _: True, lambda: None)

    def _told(self, name: str, values: Callable[[], Values], truth: Truth) -> Callable[[], Values]:
        """What a device measures, and from when the shaft is held first what is planted in its place."""
        planted, plant = truth.planted(name), self._plant
        if not planted:
            return values

        def told() -> Values:
            held = plant.mode == LEVITATE
            self._held_from = plant.tick if held and self._held_from is None else self._held_from
            passed_s = (plant.tick - (self._held_from or 0)) * plant.tick_s
            return {**values(), **(planted if held and passed_s < PLANTED_S else {})}

        return told


@dataclass(frozen=True)
class Followed:
    """A simulated rig's clock, whose register devices follow after every sleep."""

    base: Clock
    bank: RegisterBank

    def now_ns(self) -> int:
        return self.base.now_ns()

    def sleep(self, seconds: float) -> None:
        self.base.sleep(seconds)
        self.bank.tick(self.base.now_ns())


def _obeyed(device: RegisterBankDevice, drive: SimulatedDrive, names: Sequence[str]) -> bool:
    """Carry out what a write to the drive means: a command where its registers hold one, a speed."""
    commands = device.spec.commands
    try:
        if "acceleration" in names and not drive.accelerate(device.kept("acceleration")[1]):
            return False
        if "target_speed" in names:
            drive.aim(device.kept("target_speed")[1])
        touched = {register for command in commands.values() for register in command} & set(names)
        if touched:
            meant = [c for c, w in commands.items() if all(device.kept(r)[0] == raw for r, raw in w.items())]
            for command in meant:
                drive.obey(command)
            return bool(meant)
    except ValueError:
        return False
    return True


def _words(register: Register, value: float, spec: Device) -> Words:
    """A value as registers; a device that cannot show it shows the nearest that it can."""
    try:
        return register.words(value, spec.word_order)
    except ValueError:
        low, high = RANGES[register.type]
        return register.raw_words(high if (value > 0) == (register.scale > 0) else low, spec.word_order)
