"""What holds a rotor, as the rig file has it: its bearings from the near end to the far one, each axis with its channels."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass

from bench.errors import Lacking
from bench.rigfile.elements import Probe
from bench.rigfile.model import RigFile
from bench.rigfile.once import once_per_rig as once_per_rig  # those who ask for bearings ask once
from bench.rigfile.places import PlaceError, Places

ALONG_RAD = math.radians(1.0)  # a probe that looks another way than an axis by more is not the axis' own


@dataclass(frozen=True)
class SupportedAxis:
    """An axis of a bearing: `direction` around the shaft in rad (0.0 of an axial one); `coils`, the channels of the currents
    that pull to its positive and to its negative side; `voltages`, those of the same coils, if they are told; `position`, the
    channel of the probe that looks its way ("" where none does)."""

    name: str
    bearing: str
    direction: float
    coils: tuple[str, ...]
    voltages: tuple[str, ...]
    position: str


@dataclass(frozen=True)
class Support:
    """A magnetic bearing; `at` its place along the shaft, m; `voltage` the channel of its greatest coil voltage, if told."""

    name: str
    at: float
    axes: tuple[SupportedAxis, ...]
    voltage: str = ""


def radial_supports(rig: RigFile) -> tuple[Support, ...]:
    """The radial bearings, the nearest to the near end first; the axes of each in the order of the rig file.

    Raises:
        Lacking: the place or a direction of one cannot be told.
    """
    places = Places(rig)
    try:
        found = [_radial(rig, places, name) for name, b in rig.bearings.items() if b.kind == "radial"]
    except PlaceError as error:
        raise Lacking(str(error)) from error
    return tuple(sorted(found, key=lambda s: s.at))


def axial_support(rig: RigFile) -> SupportedAxis | None:
    """The axis of the axial bearing, with the probe along the shaft; None where there is none."""
    for name, b in rig.bearings.items():
        for axis, a in b.axes.items() if b.kind == "axial" else ():
            along = [p.channel for p in rig.probes.values() if p.direction is None]
            return SupportedAxis(axis, name, 0.0, a.coils, a.voltages, along[0] if along else "")
    return None


def least_clearance(rig: RigFile) -> float:
    """Of the radial rings, m: how far the centred shaft is from the nearest; infinite where there is none or none is told."""
    places, out = Places(rig), math.inf
    for name, ring in rig.rings.items():
        if ring.kind == "radial":
            with suppress(PlaceError):
                clearance = places.number(ring.clearance, f"rings.{name}.clearance")
                out = min(out, abs(clearance.number.value))
    return out


def two_planes(rig: RigFile, *, probed: bool = True) -> tuple[Support, Support]:
    """The two radial bearings of a rotor, each of two axes with two coils and, if `probed`, a probe that looks along.

    Raises:
        Lacking: there are others, or something of them is missing.
    """
    found = radial_supports(rig)
    if len(found) != 2:
        raise Lacking(f"bearings: found {len(found)} radial; expected two")
    lines = []
    for s in found:
        if len(s.axes) != 2:
            lines.append(f"bearings.{s.name}.axes: found {', '.join(a.name for a in s.axes)}; expected two")
        lines += [
            f"bearings.{s.name}.axes.{a.name}.coils: found {len(a.coils)}; expected two"
            for a in s.axes
            if len(a.coils) != 2
        ]
    if probed:
        lines += [f"probes: found none that looks along {a.name} of bearing {s.name}"
                  for s in found for a in s.axes if not a.position]  # fmt: skip
    if lines:
        raise Lacking(*lines)
    return found[0], found[1]


def _radial(rig: RigFile, places: Places, name: str) -> Support:
    at = places.place(f"bearings/{name}").value
    looking = {key: p for key, p in rig.probes.items() if p.direction is not None}
    axes = []
    for axis, a in rig.bearings[name].axes.items():
        way = places.direction(f"bearings/{name}/{axis}").value
        probe = _nearest(rig, places, looking, name, way)
        axes.append(SupportedAxis(axis, name, way, a.coils, a.voltages, probe))
    return Support(name, at, tuple(axes), rig.bearings[name].voltage)


def _nearest(rig: RigFile, places: Places, looking: dict[str, Probe], bearing: str, way: float) -> str:
    """Of the probes that look along a direction and that stand nearer to this bearing than to another, the nearest."""
    planes = {b: places.place(f"bearings/{b}").value for b, part in rig.bearings.items() if part.kind == "radial"}
    fitting: list[tuple[float, str]] = []
    for key, probe in looking.items():
        at = places.place(f"probes/{key}").value
        off = math.remainder(places.direction(f"probes/{key}").value - way, 2 * math.pi)
        if abs(off) < ALONG_RAD and min(planes, key=lambda b: abs(planes[b] - at)) == bearing:
            fitting.append((abs(planes[bearing] - at), probe.channel))
    return min(fitting)[1] if fitting else ""
