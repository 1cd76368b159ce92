"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE, STATUS
from procedures.servomotor import hold
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.parameters import BIASES, needed
from procedures.torque_constant.inputs import SIDES


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded while loads hang on the lever."""
    return (ANGLE, *machine.segments, *machine.coils_of("xo", "yo"), STATUS)


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
