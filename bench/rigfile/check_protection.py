"""What is wrong with a rig file's protection: limits that cannot be, names that lead nowhere, a levitated rotor without one."""

from __future__ import annotations

import math
from collections.abc import Iterator

from bench import units
from bench.errors import Problem
from bench.rigfile import protection
from bench.rigfile.model import Channel, RigFile
from bench.rigfile.registers import Register
from bench.rigfile.stage import axes_of, is_stage

BY_KIND = ("max_current_A", "max_temperature_K", "max_speed_rad_s", "max_levitated_position_m")
NEEDED = {
    "A": ("current", "a channel of unit A with max_current_A, or with `protect` of its own"),
    "m": ("position", "a channel of unit m with max_levitated_position_m, or with `protect` of its own"),
}
"""Of a machine that levitates, by SI unit: what goes by it, and what gives it a limit."""


def problems_of(rig: RigFile) -> Iterator[Problem]:
    """Names of `envelope`, limits that channels and registers state themselves, and what a levitated rotor lacks."""
    yield from _envelope(rig)
    for name, channel in rig.channels.items():
        yield from _own(rig, f"channels.{name}", channel)
    for device, spec in rig.devices.items():
        for name, register in spec.registers.items():
            yield from _own(rig, f"devices.{device}.registers.{name}", register)
    yield from _kinds(rig)
    yield from _levitated(rig)
    yield from _positioned(rig)


def _kinds(rig: RigFile) -> Iterator[Problem]:
    """A kind of which the machine has readings without a limit of their own has one."""
    endless = [p for p in protection.all_of(rig) if p.key in BY_KIND and math.isinf(p.high)]
    for key in dict.fromkeys(p.key for p in endless):
        yield Problem(rig.path, f"envelope.{key}", "nothing", "a value")


def _envelope(rig: RigFile) -> Iterator[Problem]:
    """What it names exists and is of its kind; a supply by its usual name is protected where there is one."""
    e = rig.envelope
    named = [("positions", name, "m") for name in e.positions or ()]
    named += [("supply", e.supply, "V")] if "supply" in e.model_fields_set else []
    for key, name, si in named:
        channel = rig.channels.get(name)
        if channel is None:
            yield Problem(rig.path, f"envelope.{key}", name, "a channel of this rig")
        elif channel.unit in units.UNITS and units.UNITS[channel.unit].si != si:
            yield Problem(rig.path, f"envelope.{key}", f"{name} in {channel.unit}", f"a channel of the kind of {si}")
        elif key == "positions" and channel.unprotected:
            yield Problem(rig.path, f"envelope.{key}", f"{name}, which is `unprotected`", "one of the two")
    low, high = e.min_supply_V or 0.0, e.max_supply_V
    if high is not None and high <= low:
        yield Problem(rig.path, "envelope.max_supply_V", f"{high:g}", f"more than min_supply_V = {low:g}")


def _own(rig: RigFile, key: str, reading: Channel | Register) -> Iterator[Problem]:
    limit = reading.protect
    if limit is None:
        return
    if limit.low is None and limit.high is None:
        yield Problem(rig.path, f"{key}.protect", "neither low nor high", "one of them, or both, in SI")
    elif limit.low is not None and limit.high is not None and limit.low >= limit.high:
        yield Problem(rig.path, f"{key}.protect", f"low {limit.low:g}, high {limit.high:g}", "low < high")
    if reading.unprotected:
        yield Problem(rig.path, f"{key}.unprotected", "a reason, beside `protect`", "one of the two")


def _positioned(rig: RigFile) -> Iterator[Problem]:
    """Of axes that are positioned, each stroke and each rate that is told has a limit, and some current has one."""
    if not is_stage(rig) or any(c.unit not in units.UNITS for c in rig.channels.values()):
        return
    found = {p.name: p.unit for p in protection.of_channels(rig)}
    for name, axis in axes_of(rig).items():
        for channel in (axis.channel if axis.measures == "stroke" else "", axis.speed):
            if channel in rig.channels and channel not in found:
                yield Problem(rig.path, f"channels.{channel}.protect", f"nothing, though {name} is moved",
                              'low and high, in SI; of a stroke with when = "held", as it is known then')  # fmt: skip
    if "A" not in found.values():
        what, expected = NEEDED["A"]
        yield Problem(rig.path, "envelope", f"no {what} that is protected, though the machine is moved", expected)


def _levitated(rig: RigFile) -> Iterator[Problem]:
    """Nothing but its limits stops a run whose rotor touches or whose coils burn. What cannot be told is not asked for."""
    doubtful = any(c.unit not in units.UNITS for c in rig.channels.values())
    unknown = any(name not in rig.channels for name in rig.envelope.positions or ())
    if doubtful or not any("levitation" in d.roles for d in rig.devices.values()):
        return
    found = {p.unit for p in protection.of_channels(rig)}
    for si, (what, expected) in NEEDED.items():
        if si not in found and not (si == "m" and unknown):
            yield Problem(rig.path, "envelope", f"no {what} that is protected, though the rotor levitates", expected)
