"""What is protected: each reading of a rig with its own limit or its kind's, by its unit and its device's role; and what is
without a limit, and why."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from bench import units
from bench.rigfile.model import RigFile
from bench.rigfile.registers import Bounds

KINDS = ("A", "K", "rad/s", "V", "m")
"""SI units of what a machine is protected by, in the order in which a trip looks."""
IDLE = ("1", "rad", "s")
"""SI units of what no limit is missed for: codes, counts, angles, times."""
AMBIENT = "ambient"  # of a thermal monitor's registers the one that is no winding's
LEAST_V = 0.1  # a supply that gives less is off, whatever it says and whatever the rig file states
OWN = "protect"  # the key by which a channel or register states a limit of its own


@dataclass(frozen=True)
class Protected:
    """A reading and what it may be at least and at most, in its SI unit. `key` of the rig file says so: `protect`, or a key
    of `envelope`; `held`: only while the rotor is held."""

    name: str
    low: float
    high: float
    unit: str
    key: str
    held: bool = False


@dataclass(frozen=True)
class Unprotected:
    """A reading of a machine without a limit, and why it has none ("" where the rig file does not say)."""

    name: str
    why: str = ""


def of_channels(rig: RigFile) -> tuple[Protected, ...]:
    """The channels of the telemetry that are protected: those that always are, then those that are while the rotor is held."""
    found = [p for name in rig.channels if (p := _of_channel(rig, name)) is not None]
    order = {si: k for k, si in enumerate(KINDS)}
    return tuple(sorted(found, key=lambda p: (p.held, order.get(p.unit, len(KINDS)))))


def of_registers(rig: RigFile, device: str) -> dict[str, Protected]:
    """The registers of a device that are protected, by their names."""
    found = {name: _of_register(rig, device, name) for name in rig.devices[device].registers}
    return {name: p for name, p in found.items() if p is not None}


def all_of(rig: RigFile) -> tuple[Protected, ...]:
    """Channels and registers."""
    return (*of_channels(rig), *(p for device in rig.devices for p in of_registers(rig, device).values()))


def without(rig: RigFile) -> Iterator[Unprotected]:
    """What a machine does and no limit bounds: channels, and registers that are read."""
    known = {p.name for p in all_of(rig)}
    for name, c in rig.channels.items():
        unit = units.UNITS.get(c.unit)
        if name not in known and unit is not None and unit.si not in IDLE:
            yield Unprotected(name, c.unprotected or _why(rig, name, unit.si))
    for device, spec in rig.devices.items():
        for name, r in spec.registers.items():
            if f"{device} {name}" not in known and not r.writable and units.unit(r.unit).si not in IDLE:
                yield Unprotected(f"{device} {name}", r.unprotected)


def _why(rig: RigFile, channel: str, si: str) -> str:
    return "not in envelope.positions" if si == "m" and rig.envelope.positions is not None else ""


def _of_channel(rig: RigFile, name: str) -> Protected | None:
    c = rig.channels[name]
    unit = units.UNITS.get(c.unit)
    if unit is None or c.unprotected:
        return None
    held = unit.si == "m" or name == rig.envelope.supply
    return _own(c.protect, name, unit.si, held) if c.protect is not None else _of_kind(rig, name, unit.si)


def _own(limit: Bounds, name: str, si: str, held: bool) -> Protected:
    low = -math.inf if limit.low is None else limit.low
    high = math.inf if limit.high is None else limit.high
    return Protected(name, low, high, si, OWN, held if limit.when is None else limit.when == "held")


def _of_kind(rig: RigFile, name: str, si: str) -> Protected | None:
    e = rig.envelope
    if si == "A":
        return Protected(name, -e.max_current_A, e.max_current_A, si, "max_current_A")
    if si == "K":
        return Protected(name, -math.inf, e.max_temperature_K, si, "max_temperature_K")
    if si == "rad/s":
        return Protected(name, -e.max_speed_rad_s, e.max_speed_rad_s, si, "max_speed_rad_s")
    if si == "m" and (e.positions is None or name in e.positions):
        return Protected(name, -e.max_levitated_position_m, e.max_levitated_position_m, si,
                         "max_levitated_position_m", held=True)  # fmt: skip
    if si == "V" and name == e.supply and (e.min_supply_V, e.max_supply_V) != (None, None):
        return _supply(rig, name)
    return None


def _supply(rig: RigFile, name: str) -> Protected:
    """What the supply's voltage may be while the rotor is held: what the rig file states, and never nothing."""
    e = rig.envelope
    stated = [key for key in ("min_supply_V", "max_supply_V") if getattr(e, key) is not None]
    low, high = e.min_supply_V or LEAST_V, e.max_supply_V or math.inf
    return Protected(name, low, high, "V", ", ".join(stated) or "less is off", held=True)


def _of_register(rig: RigFile, device: str, name: str) -> Protected | None:
    """By its own limit, by what a role knows it as, or by its kind where it is a reading."""
    spec = rig.devices[device]
    r, roles = spec.registers[name], spec.roles
    si, told = units.unit(r.unit).si, f"{device} {name}"
    voltage = "supply" in roles and name == "voltage"
    if r.unprotected:
        return None
    if r.protect is not None:
        return _own(r.protect, told, si, held=voltage)
    if voltage:
        return _supply(rig, told)
    if "drive" in roles and name == "torque" and (most := rig.envelope.max_drive_torque_Nm) is not None:
        return Protected(told, -most, most, si, "max_drive_torque_Nm")
    ambient = "thermal" in roles and name == AMBIENT
    return _of_kind(rig, told, si) if si in ("K", "rad/s") and not (r.writable or ambient) else None
