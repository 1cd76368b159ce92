"""Truths of a map of cogging."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def harmonics(done: Simulated) -> Found:
    from procedures.cogging_map.sweeps import loops
    from procedures.position_loops.injection import ability

    plan: Any = done.recording.plan
    rig, of = done.recording.rig, done.drawn.machine.motions.cogging
    if of is None:
        return
    lines = {ability(rig).loops[loop].channel: loop for loop in loops(rig, plan)}
    motion = rig.capabilities.motion
    assert motion is not None
    place = plan.parameters.get(motion.place, rig.parameters[motion.place].default)
    for (name, where), value in of(rig, done.drawn, plan.speed_rad_s, place).items():
        line, comma, part = where.partition(", ")
        if line in lines:
            yield name, lines[line] + comma + part, value
