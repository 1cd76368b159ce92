"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATUS
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.parameters import BIASES, needed
from procedures.shared.unsupported import of_motors

AXES = ("yi", "yo", "xi", "xo")


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded at a level, besides the flags."""
    return (*machine.coils_of(*AXES), *machine.segments, *machine.positions_of(*AXES))


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        lacks=(*machine.lacks, *of_motors(rig)),
        roles=("levitation", "rotation"),
        channels=(*channels(machine), STATUS),
        sensors=(*machine.coils_of(*AXES), *machine.segments),
        parameters=needed(rig, *BIASES, "motor.ramp", "motor.across", "motor.along"),
        geometry=("amb_span", "motor_to_outboard_amb", "amb_gap", "motor_stiffness", *machine.levers),
        machine=("amb_asymmetry", "pole_pairs"),
    )
