"""Where a rig is not as procedures take it: each is refused by name, none is taken for something else."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from bench.rigfile import RigFile
from bench.rigfile.places import CENTRE, PlaceError, Places
from bench.rigfile.supports import Support
from bench.rigfile.toleranced import Toleranced

TURNED_RAD = math.radians(5.0)  # from where an axis should be: the tolerance of a mounting is less
APART_M = 1e-3  # of a place by the machine's tables from that by `geometry`


def unlike(rig: RigFile, planes: tuple[Support, Support]) -> tuple[str, ...]:
    """For what takes two planes of like axes, a line each: axes of one plane that look where those of the other do, probes that
    grow along their axis, a shaft that turns counter-clockwise, and numbers of `geometry` that say what the machine's tables
    say."""
    return (*crooked(rig, planes), *contradicted(rig, planes))


def crooked(rig: RigFile, planes: tuple[Support, Support]) -> tuple[str, ...]:
    """How a machine is not two planes of like axes, each read along itself, of a shaft that turns counter-clockwise."""
    return (*_twisted(planes), *_sense(rig), *_probes(rig, planes))


def of_weight(rig: RigFile, planes: tuple[Support, Support], frame: tuple[float, float]) -> tuple[str, ...]:
    """For what goes by the shaft's weight: axes of both planes at the angles of a `frame` in rad, and a shaft that lies."""
    return (*_turned(planes, frame), *_tilt(rig))


def of_motors(rig: RigFile) -> tuple[str, ...]:
    """For what a motor's force or torque is measured with: the first segment is up."""
    return tuple(
        f"motors.{name}.direction: found a first segment that is not up; this procedure takes one that is"
        for name, motor in rig.motors.items()
        if motor.direction is not None
        and abs(math.remainder(Places(rig).direction(f"motors/{name}").value, 2 * math.pi)) > TURNED_RAD
    )


def _turned(planes: Sequence[Support], frame: tuple[float, float]) -> Iterator[str]:
    pairs = [pair for plane in planes for pair in zip(plane.axes, frame, strict=True)]
    if any(abs(math.remainder(axis.direction - angle, 2 * math.pi)) > TURNED_RAD for axis, angle in pairs):
        turned = ", ".join(f"{axis.name} at {math.degrees(axis.direction):.3g}°" for axis, _ in pairs)
        first, second = (f"{math.degrees(angle):.3g}°" for angle in frame)
        yield f"bearings: found axes {turned}; expected them at {first} and {second}"


def _twisted(planes: Sequence[Support]) -> Iterator[str]:
    one, other = planes
    for a, b in zip(one.axes, other.axes, strict=True):
        if abs(math.remainder(a.direction - b.direction, 2 * math.pi)) > TURNED_RAD:
            told = f"{a.name} at {math.degrees(a.direction):.3g}°, {b.name} at {math.degrees(b.direction):.3g}°"
            yield f"bearings: found axes {told}; expected the axes of both bearings at the same angles"


def _sense(rig: RigFile) -> Iterator[str]:
    if rig.shaft is not None and rig.shaft.sense < 0:
        yield "shaft.sense: found -1; this procedure takes a speed that is positive counter-clockwise"


def _tilt(rig: RigFile) -> Iterator[str]:
    if rig.shaft is None:
        return
    if rig.shaft.tilt is not None and abs(_value(rig, rig.shaft.tilt, "shaft.tilt")) > TURNED_RAD:
        yield "shaft.tilt: found a shaft that does not lie; this procedure takes one that does"


def _probes(rig: RigFile, planes: Sequence[Support]) -> Iterator[str]:
    read = {axis.position for plane in planes for axis in plane.axes}
    for name, probe in rig.probes.items():
        if probe.sign < 0 and probe.channel in read:
            yield (f"probes.{name}.sign: found -1; this procedure takes readings that grow along the axis: give the DBC's "
                   "factor its sign")  # fmt: skip


def contradicted(rig: RigFile, planes: tuple[Support, Support]) -> Iterator[str]:
    """Distances from the centre of mass that procedures read from `geometry`, where the tables put the part elsewhere."""
    places = Places(rig)
    for side, plane, towards in zip(("inboard", "outboard"), planes, (-1.0, 1.0), strict=True):
        channels = {axis.position for axis in plane.axes}
        read = [f"probes/{name}" for name, probe in rig.probes.items() if probe.channel in channels]
        for key, parts in ((f"com_to_{side}_amb", [f"bearings/{plane.name}"]), (f"com_to_{side}_sensor", read)):
            for part in parts if key in rig.geometry else ():
                try:
                    told = towards * places.distance(CENTRE, part).value
                except PlaceError:
                    continue
                stated = rig.geometry[key].value
                if abs(told - stated) > APART_M:
                    yield (f"geometry.{key}: found {1e3 * stated:.4g} mm, but {part} stands {1e3 * told:.4g} mm "
                           f"to the {side} side of the centre of mass; this procedure takes the first")  # fmt: skip


def _value(rig: RigFile, stated: Toleranced | str, key: str) -> float:
    term = Places(rig).number(stated, key)
    return term.factor * term.number.value
