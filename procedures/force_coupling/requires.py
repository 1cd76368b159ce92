"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATUS
from procedures.servomotor import carrying
from procedures.servomotor.conventions import conventions
from procedures.servomotor.parameters import needed
from procedures.servomotor.steps import POSITIONS, channels
from procedures.shared.unsupported import of_motors

GEOMETRY = ("com_to_inboard_sensor", "com_to_outboard_sensor", "com_to_inboard_amb", "com_to_motor", "motor_stiffness")


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        lacks=(*machine.lacks, *of_motors(rig)),
        roles=("levitation", "rotation"),
        channels=(*channels(machine), STATUS),
        sensors=(*machine.segments, *machine.positions_of(*POSITIONS)),
        parameters=needed(rig, *carrying.NEEDED, "motor.phase", "motor.segment_limit"),
        geometry=GEOMETRY,
        machine=("pole_pairs",),
    )
