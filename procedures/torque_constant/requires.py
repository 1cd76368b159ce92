"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from procedures.servomotor import hold
from procedures.servomotor.conventions import conventions
from procedures.servomotor.parameters import BIASES, needed
from procedures.torque_constant.inputs import SIDES
from procedures.torque_constant.steps import channels


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        lacks=machine.lacks,
        roles=("levitation", "rotation"),
        channels=channels(machine),
        sensors=machine.turning,
        parameters=needed(rig, *hold.NEEDED, "motor.phase", "motor.across", "motor.along", "motor.ramp", *BIASES),
        geometry=tuple(f"lever_{s}" for s in SIDES),
        machine=("pole_pairs",),
        masses=True,
    )
