"""A device as registers: reads and writes by name, in SI, with the rig file's map; errors name the register."""

from __future__ import annotations

from collections.abc import Mapping

from bench.errors import ConfigError, DeviceUnreadable
from bench.rigfile import Device, RigFile
from bench.rigfile.registers import GAP, Register, RegisterPort, RegisterRefused, Words, grouped, values_of

NOT_THERE = (1, 2, 3)  # illegal function, data address, data value: devices differ in what they say


ROLES = ("drive", "supply", "thermal")


class RegisterDevice:
    """One device of a rig file on a port."""

    def __init__(self, name: str, spec: Device, port: RegisterPort) -> None:
        self.name, self.spec, self._port = name, spec, port
        self._blocks = grouped(spec.registers)

    def require(self, *registers: str) -> None:
        """See that the rig file states the registers that a role cannot do without.

        Raises:
            ConfigError: it does not.
        """
        missing = [r for r in registers if r not in self.spec.registers]
        if missing:
            found = ", ".join(self.spec.registers) or "none"
            raise ConfigError(f"devices.{self.name}.registers: found {found}; expected {', '.join(missing)} as well")

    def check_commands(self) -> None:
        """See that every command can be written.

        Raises:
            ConfigError: a register that is none, cannot be written, or cannot hold the value.
        """
        for name in self.spec.commands:
            self._writes(name)

    def check(self) -> dict[str, float]:
        """Read everything once. A device that has no registers in the gaps is read without bridging them.

        Raises:
            ConfigError: the device does not have a register that the rig file states; the text names it.
            LinkError: it does not answer.
        """
        for gap in (GAP, 0, -1):
            self._blocks = grouped(self.spec.registers, gap)
            try:
                return self.read()
            except RegisterRefused:
                if gap < 0:
                    self._find()
                    raise
        raise AssertionError("the last gap returns or raises")

    def _find(self) -> None:
        """Raise for a register that the device does not have."""
        for block in self._blocks:
            name, r = block.names[0], self.spec.registers[block.names[0]]
            try:
                self._port.read(block.table, block.address, block.count)
            except RegisterRefused as error:
                if error.code in NOT_THERE:
                    found = f"{r.table} address {r.address} ({r.type}), which the device refuses: {error}"
                    raise ConfigError(
                        f"devices.{self.name}.registers.{name}: found {found}; expected one that it has"
                    ) from error

    def read(self) -> dict[str, float]:
        """All values in SI, in as few requests as the map allows.

        Raises:
            LinkError: no answer, an exception response, or words that are no number (DeviceUnreadable); the text names the
                registers.
        """
        out: dict[str, float] = {}
        for block in self._blocks:
            try:
                words = self._port.read(block.table, block.address, block.count)
                out |= values_of(block, words, self.spec.registers, self.spec.word_order)
            except RegisterRefused as error:
                where = f"{self.name} ({', '.join(block.names)}): {error.where}"
                raise RegisterRefused(error.code, where) from error
            except ValueError as error:
                raise DeviceUnreadable(f"device {self.name}: {error}") from error
        return out

    def write(self, register: str, value: float) -> None:
        """Write a value in SI.

        Raises:
            ConfigError: the rig file has no such register, or one that cannot hold the value or be written.
            LinkError: the device does not answer, or refuses.
        """
        r = self._writable(register)
        try:
            words = r.words(value, self.spec.word_order)
        except ValueError as error:
            raise ConfigError(f"devices.{self.name}.registers.{register}: {error}") from error
        self._send(register, words)

    def command(self, name: str) -> None:
        """Write what the rig file states for a command.

        Raises:
            ConfigError: it states none of that name.
            LinkError: the device does not answer, or refuses.
        """
        if name not in self.spec.commands:
            known = ", ".join(self.spec.commands) or "none"
            raise ConfigError(f"devices.{self.name}.commands: found {known}; expected {name}")
        for register, words in self._writes(name).items():
            self._send(register, words)

    def _writes(self, command: str) -> dict[str, Words]:
        out = {}
        for register, raw in self.spec.commands[command].items():
            r = self._writable(register)
            try:
                out[register] = r.raw_words(raw, self.spec.word_order)
            except ValueError as error:
                raise ConfigError(f"devices.{self.name}.commands.{command}: {error}") from error
        return out

    def _writable(self, register: str) -> Register:
        r = self.spec.registers.get(register)
        if r is None or not r.writable:
            found = "no such register" if r is None else "one that cannot be written"
            raise ConfigError(f"devices.{self.name}.registers.{register}: found {found}; expected writable = true")
        return r

    def _send(self, register: str, words: Words) -> None:
        try:
            self._port.write(self.spec.registers[register].address, words)
        except RegisterRefused as error:
            raise RegisterRefused(error.code, f"{self.name} ({register}): {error.where}") from error


def register_devices(rig: RigFile) -> tuple[str, ...]:
    """Names of the rig's devices in the roles of this module."""
    return tuple(name for name, d in rig.devices.items() if set(d.roles) & set(ROLES))


def by_role(devices: Mapping[str, RegisterDevice]) -> dict[str, RegisterDevice]:
    """The device of each role.

    Raises:
        ConfigError: two devices have one role.
    """
    out: dict[str, RegisterDevice] = {}
    for device in devices.values():
        for role in device.spec.roles:
            other = out.setdefault(role, device)
            if other is not device:
                raise ConfigError(
                    f"devices.{device.name}.roles: found {role}, which {other.name} has; expected one device"
                )
    return out
