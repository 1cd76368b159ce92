"""Truths of a reluctance machine's map: as encoders read places."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def inductances(done: Simulated) -> Found:
    """Constants of the map."""
    of = done.drawn.machine.motions.inductances
    if of is not None:
        for (name, where), value in of(done.recording.rig, done.drawn).items():
            yield name, where, value


def zeros(done: Simulated) -> Found:
    """Zeros of stators. The band is what was seen: it has no truth but itself."""
    of = done.drawn.machine.motions.stators
    if of is not None:
        for (name, where), value in of(done.recording.rig, done.drawn).items():
            yield name, where, value


def statics(done: Simulated) -> Found:
    """Force and torque by load cells: at the places and currents of this run, beside the map that it held them against."""
    from procedures.static_characteristics.estimates import held_loads
    from sim_backend.stage_motion import StaticsAsked

    of = done.drawn.machine.motions.statics
    if of is None:
        return
    result = done.procedure.evaluated(done.recording).result
    loads = held_loads(result)
    asked = StaticsAsked(loads.x, loads.angle, result.rows.phase.tolist(), loads.current, result.greatest, loads.beside)
    for (name, where), value in of(done.recording.rig, done.drawn, asked).items():
        yield name, where, value
