"""Of which readings a position of the shaft is made: along y, z or x at the centre of mass, and where the probes stand.

Where both bearings have axes in the same two directions, each with a probe that looks along it, y is made of the two that
look along y by the lever rule. Elsewhere the probes see P q of q = (y, z, psi, theta), and q is by least squares of what all of
them read (procedures.amb_rotor.stations): where there are more than four, the gain of each is in where the loop holds the
shaft, and those of any four of them say another place.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.places import CENTRE, Places
from bench.rigfile.supports import radial_supports
from bench.rigfile.toleranced import Toleranced
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.stations import COORDINATES
from procedures.step.coupled import ANY, Tilting
from procedures.step.probes import is_plain

Array = npt.NDArray[np.float64]
SQUARE = math.sin(math.radians(1.0))  # of a cosine: axes that are so near to right angles are meant to be
FIRM = 0.1  # of the logarithm of what a tilt weighs: what is stated of a shaft, and two equations of it


def made_of(data: Mapping[str, npt.NDArray[Any]], shares: Mapping[str, float], count: int) -> Array:
    """A sum of channels (count,), each with its share."""
    return sum((w * data[c] for c, w in shares.items()), np.zeros(count))


def shares(rig: RigFile, axis: str) -> dict[str, float]:
    """Of which sensors the position along an axis is made at the centre of mass, and how. Where the axes of a bearing are not
    at right angles z, which is, has of the readings that look along y what the others see of it: z = (v - u cos a)/sin a."""
    machine = conventions(rig)
    if axis != "x" and not is_plain(rig):
        return _by_rows(rig, _coordinates(rig)[axis])
    names = [machine.position(a) for a in machine.along(axis)]
    if len(names) == 1:
        return {names[0]: 1.0}
    own = _by_lever(rig, axis)
    apart = _between(rig)
    if axis != "z" or abs(math.cos(apart)) < SQUARE:
        return own
    lean, aside = math.cos(apart), abs(math.sin(apart))
    seen = {c: -w * lean / aside for c, w in _by_lever(rig, "y").items()}
    return {c: w / aside for c, w in own.items()} | seen


def leans(rig: RigFile, axis: str = "y") -> bool:
    """Whether a bearing's axes, each with a control of its own, are not at right angles: y and z then share oscillations. With
    a between them the axes' stiffnesses go together as 1 + cos a and 1 - cos a, which lie far apart. Never along x."""
    machine = conventions(rig)
    own = axis != "x" and not machine.can.set_points.shaft
    return own and abs(math.cos(_between(rig))) >= SQUARE


def _between(rig: RigFile) -> float:
    """The angle between the axes of a bearing, rad."""
    machine, directions = conventions(rig), {a.name: a.direction for s in radial_supports(rig) for a in s.axes}
    return directions[machine.along("z")[0]] - directions[machine.along("y")[0]]


def _by_lever(rig: RigFile, axis: str) -> dict[str, float]:
    """What the two probes that look along y, or along z, have in the position at the centre of mass."""
    near, far = (conventions(rig).position(a) for a in conventions(rig).along(axis))
    l_is, l_os = _probe_arms(rig, axis)
    return {near: l_os / (l_is + l_os), far: l_is / (l_is + l_os)}


def _probe_arms(rig: RigFile, axis: str) -> tuple[float, float]:
    """Of the near and the far probes along y or z from the centre of mass, m: as the controller knows them, or by the rig
    file, where the two probes of a plane may stand at two places."""
    known = rig.capabilities.model
    if {"l_is", "l_os"} <= known.keys():
        return rig.parameters[known["l_is"]].default, rig.parameters[known["l_os"]].default
    machine, places = conventions(rig), Places(rig)
    by_channel = {probe.channel: name for name, probe in rig.probes.items()}
    near, far = (
        places.distance(CENTRE, f"probes/{by_channel[machine.position(a)]}").value for a in machine.along(axis)
    )
    return -near, far


def ends_of(rig: RigFile, axis: str) -> list[dict[str, float]]:
    """The position where the near and where the far probes stand, along y or z; along x the one that there is."""
    machine = conventions(rig)
    if axis == "x" or is_plain(rig):
        return [{machine.position(a): 1.0} for a in machine.along(axis)]
    q, probes = _coordinates(rig), machine.stations.probes
    out = []
    for pair in machine.planes.values():
        at = float(np.mean([probes[machine.positions[k]].arm.value for k in pair]))
        out.append(_by_rows(rig, q["y"] + at * q["theta"] if axis == "y" else q["z"] - at * q["psi"]))
    return out


def _coordinates(rig: RigFile) -> dict[str, Array]:
    """Of each coordinate of the shaft, what it is of the readings (n,) of the radial probes."""
    return dict(zip(COORDINATES, np.linalg.pinv(conventions(rig).stations.reads), strict=True))


def _by_rows(rig: RigFile, shares: Array) -> dict[str, float]:
    return dict(zip(conventions(rig).stations.channels, map(float, shares), strict=True))


def tilting_of(rig: RigFile) -> Tilting:
    """How much a tilt weighs beside a displacement, by what the rig file says of the shaft: J/(m a b) where the control goes by
    probes at +-a, J/(m b²) where the magnets do (half the distances of the planes); they differ by a/b, which is not told."""
    stations, shaft = conventions(rig).stations, rig.shaft
    near_far = [[p.arm.value for p in of.values()] for of in (stations.probes, stations.axes)]
    mass, inertia = (None, None) if shaft is None else (shaft.mass, shaft.transverse_inertia)
    if not (isinstance(mass, Toleranced) and isinstance(inertia, Toleranced) and all(near_far)):
        return ANY
    a, b = ((max(arms) - min(arms)) / 2 for arms in near_far)
    if min(a, b) <= 0:
        return ANY
    weighs = math.log(inertia.value / mass.value / (a * b))
    return Tilting(weighs, math.hypot(FIRM, math.log(a / b)))
