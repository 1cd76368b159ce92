"""Currents by which motors give force: motors, loops, channels and numbers that a rig file has."""

from __future__ import annotations

from collections.abc import Iterator

from bench import units
from bench.rigfile.capabilities_of_loops import ForceCurrent
from bench.rigfile.check_current_steps import Line, near
from bench.rigfile.model import RigFile
from bench.rigfile.places import Places

PARAMETERS = {"added": ("A",), "zero": ("rad",), "flux": ("Wb",), "feedforward": ("N", "N m")}


def problems_of(rig: RigFile) -> Iterator[Line]:
    """Each with its key, what was found and what is expected; parameters that there are none of are told elsewhere."""
    can, taken = rig.capabilities.loop_injection, dict[str, str]()
    loops = {} if can is None else can.loops
    captured, known = {} if rig.capture is None else rig.capture.channels, Places(rig).known
    for motor, one in rig.capabilities.force_currents.items():
        key = f"force_currents.{motor}"
        if motor not in rig.motors:
            yield key, motor, f"a motor of this file{near(motor, rig.motors)}"
        if one.loop not in loops:
            yield f"{key}.loop", repr(one.loop), f"one of loop_injection.loops{near(one.loop, loops)}"
        for told in (rig.channels, captured):
            if one.current not in told:
                yield (
                    f"{key}.current",
                    repr(one.current),
                    f"a channel of this file, and of captures{near(one.current, told)}",
                )
            elif units.UNITS[told[one.current].unit].si != "A":
                yield f"{key}.current", f"{one.current}, in {told[one.current].unit}", "a channel in A"
        if one.along and one.along not in rig.capabilities.current_steps:
            yield (
                f"{key}.along",
                repr(one.along),
                f"a key of current_steps{near(one.along, rig.capabilities.current_steps)}",
            )
        yield from _parameters(rig, key, one)
        for name in ("along", "zero"):
            value = getattr(one, name)
            if value and (first := taken.setdefault(f"{name} {value}", key)) != key:
                yield f"{key}.{name}", value, f"one of its own: it is that of {first}"
        if one.period not in known:
            yield f"{key}.period", repr(one.period), f"the place of a number of this file{near(one.period, known)}"
        elif known[one.period].unit not in ("m", "1"):
            yield f"{key}.period", f"{one.period}, in {known[one.period].unit}", "a length, or a number of turns"
        elif known[one.period].value <= 0:
            yield f"{key}.period", f"{one.period}, {known[one.period].value:g}", "more than 0"
        if one.stated.unit != "rad":
            yield f"{key}.stated", one.stated.unit, "an angle"
        if one.constant is not None and one.constant.unit not in ("N/A", "N m/A"):
            yield f"{key}.constant", one.constant.unit, "force or torque per ampere"


def _parameters(rig: RigFile, key: str, one: ForceCurrent) -> Iterator[Line]:
    for name, si in PARAMETERS.items():
        parameter = rig.parameters.get(getattr(one, name))
        if parameter is not None and parameter.unit in units.UNITS and units.UNITS[parameter.unit].si not in si:
            yield f"{key}.{name}", f"{getattr(one, name)}, in {parameter.unit}", f"a parameter in {' or '.join(si)}"
