"""What a page is told of a rig before samples come: channels in groups with kinds and limits, orbits, names of states."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench import display_units
from bench.errors import BenchError
from bench.rigfile import RigFile, protection
from bench.rigfile.places import PlaceError, Places
from bench.rigfile.roles import SPEED, told_in
from bench.rigfile.supports import least_clearance
from bench.samples import StreamLayout

KINDS: Mapping[str, str] = {"m": "position", "A": "current", "rad/s": "speed", "K": "temperature", "V": "supply"}
CONTROLLER = "controller"
ZONES = (("A/B", 0.3), ("B/C", 0.4), ("C/D", 0.5))
"""Ends of the zones of the shaft's displacement, of the least clearance (ISO 14839-2:2004, 5.2)."""
PLANE_M = 1e-3  # probes that stand nearer to each other look at one plane


@dataclass(frozen=True)
class Shown:
    """A channel as the page shows it; limits in SI."""

    name: str
    unit: str
    kind: str
    group: str
    lower: float | None
    upper: float | None
    stream: str

    def told(self) -> dict[str, Any]:
        size = max((abs(limit) for limit in (self.lower, self.upper) if limit is not None), default=0.0)
        symbol, factor, offset = display_units.of_channel(self.unit, size)
        return {"name": self.name, "unit": self.unit, "kind": self.kind, "group": self.group, "lower": self.lower,
                "upper": self.upper, "display_unit": symbol, "factor": factor, "offset": offset}  # fmt: skip


@dataclass(frozen=True)
class Orbit:
    """A plane in which two probes look: their channels, and the matrix (2, 2) from their readings to right and up as seen from
    outside the far end, m."""

    name: str
    channels: tuple[str, str]
    matrix: npt.NDArray[np.float64]
    clearance: float | None

    def told(self) -> dict[str, Any]:
        """With its zones; x is to the right and y up."""
        c = self.clearance
        zones = [] if c is None else [{"name": name, "radius_m": share * c} for name, share in ZONES]
        return {"name": self.name, "x": self.channels[0], "y": self.channels[1], "clearance_m": c, "zones": zones}


@dataclass(frozen=True)
class View:
    """Of one rig: `speed` is the channel of the mark's speed, "" where there is none."""

    channels: tuple[Shown, ...]
    orbits: tuple[Orbit, ...]
    states: Mapping[int, str]
    faults: Mapping[int, str]
    speed: str

    def told(self) -> dict[str, Any]:
        return {
            "channels": [c.told() for c in self.channels],
            "orbits": [o.told() for o in self.orbits],
            "states": {str(code): name for code, name in self.states.items()},
            "faults": {str(code): name for code, name in self.faults.items()},
        }


def view_of(rig: RigFile, streams: Sequence[StreamLayout]) -> View:
    """What there is to see of a rig whose streams are these."""
    limits = {p.name: (_finite(p.low), _finite(p.high)) for p in protection.of_channels(rig)}
    groups = _groups(rig)
    channels = [
        Shown(c.name, c.unit, _kind(rig, c.name, c.unit), _group(rig, groups, stream.name, c.name, c.unit),
              *limits.get(c.name, (None, None)), stream.name)
        for stream in streams for c in stream.channels
    ]  # fmt: skip
    states, faults = (rig.choices(name) if name in rig.channels else {} for name in ("state", "fault"))
    return View(tuple(channels), tuple(_orbits(rig)), states, faults, told_in(rig, SPEED))


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _kind(rig: RigFile, name: str, unit: str) -> str:
    if name in rig.channels:
        with suppress(BenchError, KeyError):
            if rig.choices(name):
                return "state"
    return KINDS.get(unit, "other")


def _groups(rig: RigFile) -> dict[str, str]:
    """By channel: the bearing, plane or motor to which it belongs."""
    found: dict[str, str] = {}
    for name, bearing in rig.bearings.items():
        for axis in bearing.axes.values():
            found |= dict.fromkeys((*axis.coils, *axis.voltages), name)
        found |= {bearing.voltage: name} if bearing.voltage else {}
    for name, probe in rig.probes.items():
        found[probe.channel] = _bearing_of(rig, name) or "position"
    for name, motor in rig.motors.items():
        found |= dict.fromkeys(motor.currents, name)
    if rig.mark is not None:
        found |= dict.fromkeys(
            (c for c in (rig.mark.angle, rig.mark.speed, rig.mark.pulses, rig.mark.edge) if c), "rotation"
        )
    return found


def _bearing_of(rig: RigFile, probe: str) -> str:
    """The bearing that is nearest to a probe; that of the other kind's for one that looks along the shaft."""
    if rig.probes[probe].direction is None:
        return next((name for name, b in rig.bearings.items() if b.kind == "axial"), "")
    places, near = Places(rig), dict[str, float]()
    with suppress(PlaceError):
        at = places.place(f"probes/{probe}").value
        near = {
            name: abs(places.place(f"bearings/{name}").value - at)
            for name, b in rig.bearings.items()
            if b.kind == "radial"
        }
    return min(near, key=lambda name: near[name], default="")


def _group(rig: RigFile, groups: Mapping[str, str], stream: str, name: str, unit: str) -> str:
    if name in groups:
        return groups[name]
    if unit == "K":
        return "temperature"
    device = next((d for d, of in rig.devices.items() if name.startswith(f"{d}_") and of.registers), "")
    return device or CONTROLLER


def _orbits(rig: RigFile) -> Iterator[Orbit]:
    """A pair of probes for each plane in which two look in different directions; the first two of each plane."""
    places = Places(rig)
    clearance = _finite(least_clearance(rig))
    planes: list[tuple[float, list[str]]] = []
    with suppress(PlaceError):
        for name, probe in rig.probes.items():
            if probe.direction is not None:
                at = places.place(f"probes/{name}").value
                near = next((names for place, names in planes if abs(place - at) < PLANE_M), None)
                planes += [] if near is not None else [(at, near := [])]
                assert near is not None
                near.append(name)
        for _, names in sorted(planes, key=lambda plane: plane[0]):
            for k in range(1, len(names)):
                found = _orbit(rig, places, names[0], names[k], clearance)
                if found is not None:
                    yield found
                    break


def _orbit(rig: RigFile, places: Places, one: str, other: str, clearance: float | None) -> Orbit | None:
    """Readings are r = s (up cos a - right sin a), as directions count from up, counter-clockwise seen from outside the far
    end."""
    probes = [rig.probes[name] for name in (one, other)]
    angles = [places.direction(f"probes/{name}").value for name in (one, other)]
    rows = np.array([[-p.sign * math.sin(a), p.sign * math.cos(a)] for p, a in zip(probes, angles, strict=True)])
    if abs(np.linalg.det(rows)) < 0.1:
        return None
    flat = sorted((0, 1), key=lambda k: abs(math.cos(angles[k])))  # the one that looks aside is x
    names = [p.channel for p in probes]
    matrix = np.linalg.inv(rows)[:, flat]
    name = _bearing_of(rig, one) or f"{one}, {other}"
    return Orbit(name, (names[flat[0]], names[flat[1]]), np.asarray(matrix, np.float64), clearance)
