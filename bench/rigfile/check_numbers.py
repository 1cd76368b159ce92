"""The named numbers of a rig file, [geometry] and [machine]: names that something asks for, values that can be."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator

from bench.errors import Problem
from bench.rigfile.check_machine import references_in
from bench.rigfile.model import RigFile
from bench.rigfile.numbers import numbers_at
from bench.rigfile.places import WITHOUT_NUMBERS
from bench.rigfile.toleranced import Toleranced

GEOMETRY = {"amb_gap": "air gap of the radial AMBs", "clearance": "clearance of the touchdown bearings"}
SHAFT_GEOMETRY = {
    "amb_span": "AMB plane to AMB plane",
    "com_to_outboard_amb": "centre of mass to outboard AMB",
    "com_to_inboard_amb": "centre of mass to inboard AMB",
    "com_to_outboard_sensor": "centre of mass to outboard sensors",
    "com_to_inboard_sensor": "centre of mass to inboard sensors",
}
"""Of a shaft in two radial AMBs: a rig that states one of them states them all."""
HOOK_GEOMETRY = {"hook_to_outboard": "hook plane to outboard AMB plane"}
MOTOR_GEOMETRY = {"com_to_motor": "centre of mass to motor", "motor_stiffness": "negative stiffness of the motor"}
"""Of a rig on which masses hang, and of one whose controller turns the rotor."""
SOME_GEOMETRY = {
    "motor_to_outboard_amb": "motor plane to outboard AMB plane",
    "lever_left": "shaft axis to the left end of the lever",
    "lever_right": "shaft axis to the right end of the lever",
    "axial_gap": "air gap of the axial AMB",
    "com_to_inboard_balance": "centre of mass to the inboard balancing plane",
    "com_to_outboard_balance": "centre of mass to the outboard balancing plane",
    "balance_radius": "shaft axis to where weights are fixed in the balancing planes",
    "com_to_coupling": "centre of mass to the coupling of an external motor",
    "bearing_radius": "shaft axis to the balls of a bearing that lets it turn and slide",
    "coupling_stiffness": "radial stiffness of that coupling",
}
"""Lengths that a rig may have; the procedures that need one say so."""
MACHINE = {"pole_pairs": "1", "polar_inertia": "kg m^2", "ring_inertia": "kg m^2", "amb_asymmetry": "1",
           "radial_axes": "rad", "runout": "m", "coupling_offset": "m", "mass": "kg", "transverse_inertia": "kg m^2",
           "weight_mass": "kg", "weight_angle": "rad", "drive_drag": "N m",
           "segment_gain": "1", "torque_ripple": "N m/A", "resistance": "Ohm", "rotor_poles": "1", "ring_mass": "kg",
           "added_mass": "kg", "added_mass_inertia": "kg m^2", "ring_eccentricity": "m"}  # fmt: skip
OWN = "own_"
"""What the name of a number begins with that a procedure or machine from outside the repository asks for."""


def problems_of(rig: RigFile) -> Iterator[Problem]:
    """Names that are there for something, lengths that can be; of schema 1, which had no other place for them, all it asks."""
    g, needed = rig.geometry, dict[str, str]()
    if rig.written_in == 1:
        needed |= GEOMETRY | (SHAFT_GEOMETRY if SHAFT_GEOMETRY.keys() & g.keys() else {})
        needed |= HOOK_GEOMETRY if rig.masses else {}
        needed |= MOTOR_GEOMETRY if any("rotation" in d.roles for d in rig.devices.values()) else {}
    for key in sorted(needed.keys() - g.keys()):
        yield Problem(rig.path, f"geometry.{key}", "nothing", f"{needed[key]}, with its certificate")
    stepped = rig.capabilities.current_steps.values()
    used = references_in(rig) | {f"machine/{name}" for step in stepped for name in step.stated}
    used |= {one.period for one in rig.capabilities.force_currents.values()}
    for key in sorted(rig.machine.keys() - MACHINE.keys()):
        if f"machine/{key}" not in used and not key.startswith(OWN):
            expected = f"one of {', '.join(MACHINE)}, or {OWN}{key} for a procedure of your own"
            yield Problem(rig.path, f"machine.{key}", "a number nobody asks for", expected)
    known = GEOMETRY | SHAFT_GEOMETRY | HOOK_GEOMETRY | MOTOR_GEOMETRY | SOME_GEOMETRY
    for key in sorted(g.keys() - known.keys()):
        if f"geometry/{key}" not in used and not key.startswith(OWN):
            close = difflib.get_close_matches(key, known, 1)
            expected = (
                f"did you mean {close[0]}?" if close else f"no such key, or {OWN}{key} for a procedure of your own"
            )
            yield Problem(rig.path, f"geometry.{key}", "a length nobody asks for", expected)
    yield from _lengths(rig)
    yield from _identities(rig)
    if (
        rig.shaft is not None
        and isinstance(tilt := rig.shaft.tilt, Toleranced)
        and abs(tilt.value) > math.pi / 2 + 1e-9
    ):
        found = f"{math.degrees(tilt.value):g}°"
        yield Problem(rig.path, "shaft.tilt.value", found, "-90 to 90°: how far the far end is above the horizontal")


def _identities(rig: RigFile) -> Iterator[Problem]:
    """Two numbers that share an identity: draws and budgets would take one of them for both."""
    taken: dict[str, str] = {}
    tables = {name: getattr(rig, name) for name in type(rig).model_fields if name not in WITHOUT_NUMBERS}
    for place, number in numbers_at(tables):
        first = taken.setdefault(number.id or place, place)
        if first != place:
            expected = f"an identity of its own: it is that of {first.replace('/', '.')}, too"
            yield Problem(rig.path, f"{place.replace('/', '.')}.id", repr(number.id or place), expected)


def _lengths(rig: RigFile) -> Iterator[Problem]:
    g = rig.geometry
    for key, length in g.items():
        if length.value <= 0:
            yield Problem(rig.path, f"geometry.{key}.value", f"{length.value:g} {length.unit}", "a positive number")
    if rig.written_in > 1:
        return
    if {"com_to_inboard_amb", "com_to_outboard_amb", "amb_span"} <= g.keys():
        span = g["com_to_inboard_amb"].value + g["com_to_outboard_amb"].value
        if abs(span - g["amb_span"].value) > 1e-3:
            yield Problem(rig.path, "geometry.amb_span.value", f"{g['amb_span'].value:g} m",
                          f"within 1 mm of com_to_inboard_amb + com_to_outboard_amb = {span:g} m")  # fmt: skip
    if {"clearance", "amb_gap"} <= g.keys() and g["clearance"].value >= g["amb_gap"].value:
        yield Problem(rig.path, "geometry.clearance.value", f"{g['clearance'].value:g} m",
                      f"less than amb_gap = {g['amb_gap'].value:g} m, or the journal strikes the AMB first")  # fmt: skip
