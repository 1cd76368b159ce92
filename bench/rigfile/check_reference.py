"""Reference instruments that lead somewhere: axes that there are, channels of their own, numbers in the axis' unit."""

from __future__ import annotations

from collections.abc import Iterator

from bench import units
from bench.rigfile.capabilities_of_reference import ReferenceInstrument
from bench.rigfile.check_current_steps import Line, near
from bench.rigfile.elements import Encoder
from bench.rigfile.model import RigFile

UNITS = {"stroke": "m", "angle": "rad"}


def problems_of(rig: RigFile) -> Iterator[Line]:
    """Each with its key, what was found and what is expected."""
    for name, can in rig.capabilities.reference.items():
        encoder = rig.encoders.get(name)
        if encoder is None:
            yield f"reference.{name}", name, f"an axis: one of [encoders]{near(name, rig.encoders)}"
        else:
            yield from (
                (f"reference.{name}.{key}", found, expected) for key, found, expected in _one(rig, can, encoder)
            )


def _one(rig: RigFile, can: ReferenceInstrument, encoder: Encoder) -> Iterator[Line]:
    si = UNITS[encoder.measures]
    for key, channel, unit in (("channel", can.channel, si), ("temperature", can.temperature, "K")):
        if channel and channel not in rig.channels:
            yield key, repr(channel), f"a channel of this file{near(channel, rig.channels)}"
        elif channel and units.UNITS[rig.channels[channel].unit].si != unit:
            yield key, f"{channel}, in {rig.channels[channel].unit}", f"a channel in {unit}"
    if can.channel == encoder.channel:
        yield "channel", can.channel, "a channel that is not the axis' own: what it counts is no reference for itself"
    if can.unit and (can.unit not in units.UNITS or units.UNITS[can.unit].si != si):
        yield "unit", can.unit, f"a unit of {si}"
    if can.gain.unit != "1" or can.gain.value <= 0:
        yield (
            "gain",
            f"{can.gain.value:g} {can.gain.unit}",
            "a positive number without unit; sign = -1 where it counts the other way",
        )
    for key, unit in (("error", si), ("noise", si), ("drift", f"{si}/s")):
        number = getattr(can, key)
        if number is not None and (number.unit != unit or number.value != 0):
            yield key, f"{number.value:g} {number.unit}", f"a value of 0 in {unit}, with how far it may be off"
