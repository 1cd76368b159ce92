"""Truths of what a gate and a catch have to spare."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.cli.truths.settings import Found, settings_of

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated

WINDOWS = 4


def margins(done: Simulated) -> Found:
    """At the places of the plan, of the same machine levitated anew."""
    from procedures.gate_margin.place import bound_of, grid, planes
    from procedures.position_loops.movers import motion
    from sim_backend.mission_motion import GateAsked

    rig, plan, of = done.recording.rig, done.recording.plan, done.drawn.machine.motions.gates
    if of is None:
        return
    at = motion(rig)
    gate_m, gate_s = bound_of(done.recording)
    hold = rig.capabilities.hold
    limit = rig.parameters[hold.limit].default if hold is not None else 0.0
    limits = {p.probe: limit for p in planes(rig)}
    places = {p.name: (p.place_m, p.angle_rad) for p in grid(plan)}
    asked = GateAsked(settings_of(done), places, at.place, at.angle, gate_m, gate_s, WINDOWS, limits)
    for (name, where), value in of(rig, done.drawn, asked).items():
        yield name, where, value
