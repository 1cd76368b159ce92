"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile


def requires(rig: RigFile) -> Requires:
    """Currents that are stepped, and what captures read of each."""
    steps = rig.capabilities.current_steps.values()
    return Requires(
        capabilities=("current_steps",),
        parameters=tuple(step.parameter for step in steps),
        capture=tuple(dict.fromkeys(name for step in steps for name in (step.along, step.across))),
    )
