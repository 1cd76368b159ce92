"""What y, z and x are of a machine whose axes have names of their own: what the reader of a result along y must know."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

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
    told = [f"{c} is {_told(rig, machine, c, axes, zero)}" for c, axes in along.items()]
    yield Finding("coordinates", f"{'; '.join(told)}. Radial ones are told at the centre of mass.", "")


def _told(rig: RigFile, machine: AmbRotor, coordinate: str, axes: Sequence[str], zero: str) -> str:
    """How a coordinate lies to the axes that are nearest to it: y is along the first, z across y."""
    at = {axis: _direction(rig, axis) for axis in axes}
    first = at[axes[0]]
    if first is None:
        return f"along {' and '.join(axes)}"
    if coordinate == "z" and any(abs(machine.stations.share("y", axis)) >= SQUARE for axis in axes):
        y = _direction(rig, machine.along("y")[0])
        across = first if y is None else y + math.copysign(math.pi / 2, math.remainder(first - y, 2 * math.pi))
        return f"across y, to the side of {' and '.join(axes)}, {_degrees(across)}{zero}"
    beside = {a: d for a, d in at.items() if d is not None and abs(math.sin(d - first)) >= SQUARE}
    along = " and ".join(a for a in axes if a not in beside)
    return f"along {along}, {_degrees(first)}{zero}" + "".join(f" ({a} is at {_degrees(d)})" for a, d in beside.items())


def _degrees(at: float) -> str:
    return f"{math.degrees(at) % 360:.3g}°"


def _direction(rig: RigFile, axis: str) -> float | None:
    """Of a radial axis, rad; None where the file does not tell it."""
    bearing = next((name for name, b in rig.bearings.items() if axis in b.axes and b.kind == "radial"), None)
    if bearing is None:
        return None
    try:
        return Places(rig).direction(f"bearings/{bearing}/{axis}").value
    except PlaceError:
        return None
