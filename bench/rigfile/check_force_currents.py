"""Currents by which motors give force: motors, loops, channels and numbers that a rig file has."""

from __future__ import annotations

from collections.abc import Iterator

from bench import units
from bench.rigfile.check_current_steps import Line, near
from bench.rigfile.model import RigFile
from bench.rigfile.places import Places


def problems_of(rig: RigFile) -> Iterator[Line]:
    """Each with its key, what was found and what is expected; parameters that there are none of are told elsewhere."""
    can = rig.capabilities.loop_injection
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
        parameter = rig.parameters.get(one.added)
        if parameter is not None and units.UNITS[parameter.unit].si != "A":
            yield f"{key}.added", f"{one.added}, in {parameter.unit}", "a parameter in A"
        if one.period and one.period not in known:
            yield f"{key}.period", repr(one.period), f"the place of a number of this file{near(one.period, known)}"
        elif one.period and known[one.period].unit not in ("m", "1"):
            yield f"{key}.period", f"{one.period}, in {known[one.period].unit}", "a length, or a number of turns"
        if units.UNITS[one.zero.unit].si != "rad":
            yield f"{key}.zero", one.zero.unit, "an angle"
