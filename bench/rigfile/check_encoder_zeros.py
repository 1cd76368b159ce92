"""Encoder zeros: motors, currents, loops and parameters that a rig file has, in their units."""

from __future__ import annotations

from collections.abc import Iterator

from bench import units
from bench.rigfile.capabilities_of_loops import EncoderZero
from bench.rigfile.check_current_steps import near
from bench.rigfile.model import RigFile

Line = tuple[str, str, str]
PARAMETERS = {"across": "A", "zero": "rad"}


def problems_of(rig: RigFile) -> Iterator[Line]:
    """Each with its key, what was found and what is expected; parameters that there are none of are told elsewhere."""
    taken: dict[str, str] = {}
    for motor, one in rig.capabilities.encoder_zeros.items():
        key = f"encoder_zeros.{motor}"
        if motor not in rig.motors:
            yield key, motor, f"a motor of this file{near(motor, rig.motors)}"
        yield from _named(rig, key, one)
        for name, si in PARAMETERS.items():
            parameter = rig.parameters.get(getattr(one, name))
            if parameter is not None and parameter.unit in units.UNITS and units.UNITS[parameter.unit].si != si:
                yield f"{key}.{name}", f"{getattr(one, name)}, in {parameter.unit}", f"a parameter in {si}"
        for name in ("step", "zero"):
            if (first := taken.setdefault(f"{name} {getattr(one, name)}", key)) != key:
                yield f"{key}.{name}", getattr(one, name), f"one of its own: it is that of {first}"
        if one.stated is not None and one.stated.unit != "rad":
            yield f"{key}.stated", one.stated.unit, "an angle"


def _named(rig: RigFile, key: str, one: EncoderZero) -> Iterator[Line]:
    can = rig.capabilities
    if one.step not in can.current_steps:
        yield f"{key}.step", repr(one.step), f"a key of current_steps{near(one.step, can.current_steps)}"
    loops = {} if can.loop_injection is None else can.loop_injection.loops
    if one.loop not in loops:
        yield f"{key}.loop", repr(one.loop), f"a key of loop_injection.loops{near(one.loop, loops)}"
        return
    channel = rig.channels.get(loops[one.loop].channel)
    if channel is not None and one.period.unit != units.UNITS[channel.unit].si:
        yield f"{key}.period", one.period.unit, f"a length or an angle as {loops[one.loop].channel}, in {channel.unit}"
    elif one.period.value <= 0:
        yield f"{key}.period", f"{one.period.value:g}", "more than 0"
