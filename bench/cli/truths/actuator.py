"""Truths of the constants of a mover's motors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def constants(done: Simulated) -> Found:
    from procedures.actuator_constant.sines import loops, places
    from procedures.position_loops.injection import ability

    plan: Any = done.recording.plan
    rig, of = done.recording.rig, done.drawn.machine.motions.constants
    if of is None:
        return
    lines = {ability(rig).loops[loop].channel: loop for loop in loops(rig, plan)}
    names = {line: {p.value: p.name for p in places(rig, plan, loop)} for line, loop in lines.items()}
    for (name, where, at), value in of(rig, done.drawn, {line: list(some) for line, some in names.items()}).items():
        if name == "inertia" and not plan.added_inertia:
            continue
        if where in lines:
            where = f"{lines[where]}, {names[where][at]}" if name.startswith("cogging") else lines[where]
        yield name, where, value
