"""Truths of a stage's axes: the machine's own friction, mass and inertia."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated

OWN = {"coulomb": ("F_c", "T_c"), "viscous": ("D", "K")}


def of_axes(done: Simulated) -> Found:
    """Friction of each axis, what it needs both ways alike, and the bearing's radius. Friction is more upwards by its share
    `coulomb_sides`, the far end lies higher by the tilt."""
    from procedures.axis_friction.estimates import named
    from procedures.axis_friction.sequence import chosen

    true, drawn = done.truth, done.drawn.values
    lifted = true["m"] * drawn["site.gravity"] * math.sin(drawn["shaft.tilt"])
    for axis in chosen(done.recording.rig, done.recording.plan):
        around = axis.unit == "rad"
        for name, own in OWN.items():
            yield named(name, axis), axis.name, true[own[around]]
        yield named("one_sided", axis), axis.name, 0.0 if around else true["F_c"] * drawn["coulomb_sides"] + lifted
    yield "friction_radius", "", true["r_b"]


def inertia(done: Simulated) -> Found:
    """What each axis moves without a part."""
    from procedures.axis_inertia.estimates import named
    from procedures.axis_inertia.sequence import chosen

    for axis in chosen(done.recording.rig, done.recording.plan):
        yield named(axis), axis.name, done.truth["J" if axis.unit == "rad" else "m"]


def breakaway(done: Simulated) -> Found:
    """The machine's own Coulomb friction, and one along the path."""
    from procedures.axis_breakaway.estimates import named
    from procedures.axis_breakaway.sequence import chosen

    plan = done.recording.plan
    for axis in chosen(done.recording.rig, plan):
        yield named(axis), axis.name, done.truth["T_c" if axis.unit == "rad" else "F_c"]
    yield from (("path_share", f"helix {share:g}", 1.0) for share in plan.helix)
