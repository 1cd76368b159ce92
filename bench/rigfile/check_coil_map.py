"""A map of coils that leads somewhere: channels that a capture and telemetry have, parameters in amperes, axes that fit."""

from __future__ import annotations

from collections.abc import Iterator

from bench import units
from bench.rigfile.capabilities_of_coils import CoilMap, CoilSystem
from bench.rigfile.check_current_steps import Line, near
from bench.rigfile.model import RigFile

AXES = {"torque": 1, "axial force": 1, "radial force": 2}


def problems_of(rig: RigFile) -> Iterator[Line]:
    """Each with its key, what was found and what is expected; parameters that there are none of are told elsewhere."""
    found = rig.capabilities.coil_map
    if found is None:
        return
    taken: dict[str, str] = {}
    for name, system in found.systems.items():
        key = f"coil_map.systems.{name}"
        yield from _system(rig, key, system)
        for parameter in (system.d, system.q):
            if (first := taken.setdefault(parameter, key)) != key:
                yield key, parameter, f"a parameter of its own: it is that of {first}"
    yield from _coils(rig, found)


def _system(rig: RigFile, key: str, system: CoilSystem) -> Iterator[Line]:
    for name in (system.read_d, system.read_q, *system.coils):
        yield from _captured(rig, key, name, "A")
    for name in (system.angle, *system.axes):
        yield from _captured(rig, key, name, "")
        if name not in rig.channels:
            yield key, repr(name), f"a channel of telemetry{near(name, rig.channels)}"
    if len(system.axes) != AXES[system.gives]:
        yield f"{key}.axes", f"{len(system.axes)} axes", f"{AXES[system.gives]} of a {system.gives}"
    for name in (system.d, system.q):
        parameter = rig.parameters.get(name)
        if parameter is not None and parameter.unit in units.UNITS and units.UNITS[parameter.unit].si != "A":
            yield key, f"{name}, in {parameter.unit}", "a parameter in A"


def _coils(rig: RigFile, found: CoilMap) -> Iterator[Line]:
    for coil, bridge in found.bridges.items():
        yield from _captured(rig, "coil_map.bridges", bridge, "A")
        if coil not in found.coils:
            yield "coil_map.bridges", repr(coil), f"a coil of a system{near(coil, found.coils)}"
    for axis in found.still:
        if axis not in found.axes:
            yield "coil_map.still", repr(axis), f"an axis of a system{near(axis, found.axes)}"
    for star in found.stars:
        for coil in star:
            if coil not in found.coils:
                yield "coil_map.stars", repr(coil), f"a coil of a system{near(coil, found.coils)}"


def _captured(rig: RigFile, key: str, name: str, unit: str) -> Iterator[Line]:
    known = {} if rig.capture is None else rig.capture.channels
    if name not in known:
        yield key, repr(name), f"a channel of [capture]{near(name, known)}"
    elif unit and known[name].unit != unit:
        yield key, f"{name}, in {known[name].unit}", f"a channel in {unit}"
