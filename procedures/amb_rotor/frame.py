"""What y, z and x are of a machine whose axes have names of their own: what the reader of a result along y must know."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from bench.findings import Finding
from bench.rigfile import RigFile
from bench.rigfile.places import PlaceError, Places
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor

SQUARE = math.sin(math.radians(1.0))  # of a cosine: axes that are so near to right angles are meant to be


def describe(rig: RigFile, coordinates: Iterable[str]) -> Iterator[Finding]:
    """A note, where the axes' names do not begin with the coordinates that they are along."""
    machine, shaft = conventions(rig), rig.shaft
    along = {c: machine.along(c) for c in dict.fromkeys(coordinates)}
    if all(axis.startswith(c) for c, axes in along.items() for axis in axes):
        return
    zero = f" from {shaft.zero_at}" if shaft is not None and shaft.zero_at else ""
    told = [f"{c} is {_way(machine, c)}{' and '.join(axes)}{_angle(rig, axes[0], zero)}" for c, axes in along.items()]
    yield Finding("coordinates", f"{'; '.join(told)}. Radial ones are told at the centre of mass.", "")


def _way(machine: AmbRotor, coordinate: str) -> str:
    """How a coordinate lies to the axes that are nearest to it: y is along the first, z across y."""
    if coordinate != "z" or all(abs(machine.stations.share("y", axis)) < SQUARE for axis in machine.along("z")):
        return "along "
    return "across y, to the side of "


def _angle(rig: RigFile, axis: str, zero: str) -> str:
    bearing = next((name for name, b in rig.bearings.items() if axis in b.axes and b.kind == "radial"), None)
    if bearing is None:
        return ""
    try:
        at = Places(rig).direction(f"bearings/{bearing}/{axis}").value
    except PlaceError:
        return ""
    return f", {math.degrees(at) % 360:.3g}°{zero}"
