"""Keys of `[simulation]` that a twin knows (docs/reference/twin.md, what a rig file leaves open), and those that it does not: a
key that nobody looks for leaves its number to a rule, and nothing tells of it."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterator, Mapping

from bench.errors import Problem
from bench.rigfile import RigFile
from sim_backend.controller.controls import OWN
from sim_backend.machines.twin.layout import layout_of
from sim_backend.machines.twin.possible import impossible, without
from sim_backend.machines.twin.rules import BY_AXIS, BY_JOURNAL, BY_PLANE, ONCE, drawn, short

TABLES = frozenset(("readings", "faults"))
"""Tables of names, whose values `sim_backend.unspoken` looks at."""
OF_ALL = frozenset((
    "machine", "mass", "transverse_inertia", "polar_inertia", "tilt", "current_limit", "bandwidth", "derivative_hz", "notch_q",
    "lift_time", "slew", "slew_tilt", "position_lsb", "current_lsb", "stop", "mode_1_on", "mode_2_on", "trip_current",
    "trip_speed", "coupling_offset_z",
))  # fmt: skip
"""Of the whole machine, beside those of `rules.ONCE` and of the controller."""


def unknown(rig: RigFile) -> Iterator[Problem]:
    """Values that cannot be; keys that a twin never asks for, parts that it has not, each with the nearest that there is."""
    values = tuple(impossible(rig))
    yield from values
    parts, once = _parts(rig), OF_ALL | ONCE.keys() | OWN.keys()
    joined = {f"{key}_{part}" for key, names in parts.items() for part in names}
    known = {*once, *parts, *joined, *TABLES, *drawn(without(rig, values))}
    for key, said in rig.simulation.items():
        if key not in known:
            yield _problem(rig, key, "a key that the twin has no use for", known)
        elif key == "readings" and isinstance(said, Mapping):
            yield from _table(
                rig, key, said, [*rig.channels, *(rig.capture.channels if rig.capture is not None else ())]
            )
        elif isinstance(said, Mapping) and key not in TABLES:
            yield from _table(rig, key, said, parts.get(key))


def _table(rig: RigFile, key: str, said: Mapping[str, object], parts: Collection[str] | None) -> Iterator[Problem]:
    """Of a key that a table states part by part."""
    if parts is None:
        yield Problem(rig.path, f"simulation.{key}", "a table", "one number: the twin has it once")
        return
    for part in said:
        if part not in parts:
            found = "a part that the twin has no such number of"
            yield _problem(rig, part, found, parts, f"{key}.")


def _problem(rig: RigFile, name: str, found: str, known: Collection[str], table: str = "") -> Problem:
    close = difflib.get_close_matches(name, sorted(known), 1)
    listed = f"one of {', '.join(known)}" if table else "one of docs/reference/twin.md, what a rig file leaves open"
    return Problem(rig.path, f"simulation.{table}{name}", found, f"did you mean {close[0]}?" if close else listed)


def _parts(rig: RigFile) -> dict[str, tuple[str, ...]]:
    """Of each key that may be stated part by part: the names of the parts."""
    layout = layout_of(rig)
    axes = tuple(a.name for a in layout.axes)
    bearings = tuple(dict.fromkeys(a.bearing for a in layout.axes))
    probes = tuple(rig.probes[name].channel for name in layout.probes)
    out = dict.fromkeys((*BY_AXIS, "kp", "ki", "kd"), axes) | {"bias": bearings, "position_noise": probes}
    out |= dict.fromkeys(BY_PLANE, tuple(short(plane) for plane in layout.planes))
    return out | dict.fromkeys((*BY_JOURNAL, "runout_phase"), tuple(layout.journals))
