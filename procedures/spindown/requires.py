"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from procedures.servomotor import hold
from procedures.servomotor.conventions import conventions
from procedures.servomotor.parameters import BIASES, needed
from procedures.spindown import coasting
from procedures.spindown.steps import channels, coils


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    if coasting.applies(rig):
        return coasting.requires(rig)
    machine = conventions(rig)
    return Requires(
        lacks=machine.lacks,
        roles=("levitation", "rotation"),
        channels=channels(machine),
        sensors=coils(machine),
        parameters=needed(rig, *hold.NEEDED, *BIASES, "angle.speed"),
    )
