"""Truths of what holds a shaft against magnets that pull it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def pulls(done: Simulated) -> Found:
    """Where the mover was held meanwhile. Loops go by their channels, actuators and axes by the rig file's names."""
    from procedures.pull_ratio.planes import angles, axes, planes
    from procedures.pull_ratio.steps import STEP

    plan: Any = done.recording.plan
    rig, of = done.recording.rig, done.drawn.machine.motions.pulls
    steps = list(done.recording.steps(STEP))
    if of is None or not steps or rig.capabilities.motion is None:
        return
    z, angle = (
        float(np.mean([s.mean(c) for s in steps])) for c in (rig.capabilities.motion.place_channel, *angles(rig))
    )
    named = {c: loop for p in planes(rig) for c, loop in zip(p.system.axes, p.loops, strict=True)}
    left_out = {q.name for q in done.procedure.left_out(plan)}
    for (name, where), value in of(rig, done.drawn, z, angle).items():
        if name not in left_out and (where not in "xy" or not where or where in axes(rig)):
            yield name, named.get(where, where), value
