"""A hold that leads somewhere: channels of captures, numbers of the file, values in range."""

from __future__ import annotations

from collections.abc import Iterator

from bench.rigfile.check_current_steps import Line, near
from bench.rigfile.model import RigFile
from bench.rigfile.places import Places


def problems_of(rig: RigFile) -> Iterator[Line]:
    """Each with its key, what was found and what is expected; parameters that there are none of are told elsewhere."""
    can = rig.capabilities.hold
    if can is None:
        return
    captured = {} if rig.capture is None else rig.capture.channels
    numbers = Places(rig).known
    if can.force.unit != "N/A":
        yield "hold.force.unit", can.force.unit, "N/A"
    if can.middle is not None and (can.middle.unit != "m" or rig.capabilities.motion is None):
        yield "hold.middle", can.middle.unit, "a length, with capabilities.motion, which goes there"
    for key, name, unit in _channels(rig):
        if name not in captured:
            yield key, repr(name), f"a channel of [capture.channels]{near(name, captured)}"
        elif unit and captured[name].unit != unit:
            yield key, f"{name}, in {captured[name].unit}", f"a channel in {unit}"
    for key, place in _numbers(rig):
        if place not in numbers:
            yield key, repr(place), f"the place of a number of this file{near(place, numbers)}"
    taken: dict[float, str] = {}
    chooses = rig.parameters.get(can.across)
    for name, axis in can.axes.items():
        key = f"hold.axes.{name}.value"
        if chooses is not None and not chooses.low <= axis.value <= chooses.high:
            yield key, f"{axis.value:g}", f"{chooses.low:g} to {chooses.high:g}, the range of {can.across}"
        if (first := taken.setdefault(axis.value, name)) != name:
            yield key, f"{axis.value:g}", f"a value of its own: it is that of {first}"


def _channels(rig: RigFile) -> Iterator[tuple[str, str, str]]:
    can = rig.capabilities.hold
    assert can is not None
    yield "hold.held", can.held, ""
    for name, axis in can.axes.items():
        yield from ((f"hold.axes.{name}.positions", channel, "m") for channel in axis.positions)
        yield from ((f"hold.axes.{name}.currents", channel, "A") for channel in axis.currents)


def _numbers(rig: RigFile) -> Iterator[tuple[str, str]]:
    can = rig.capabilities.hold
    assert can is not None
    yield "hold.mass", can.mass
    for name, axis in can.axes.items():
        yield from ((f"hold.axes.{name}.stiffness", place) for place in axis.stiffness)
