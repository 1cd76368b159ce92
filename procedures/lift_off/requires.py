"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE, STATUS
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.parameters import needed
from procedures.servomotor.steps import POSITIONS

GEOMETRY = ("clearance", "com_to_inboard_amb", "com_to_inboard_sensor", "com_to_motor", "com_to_outboard_amb",
            "com_to_outboard_sensor", "motor_to_outboard_amb")  # fmt: skip
NEEDED = ("motor.phase", "motor.phase_slew", "motor.segment_limit")


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is read of every step."""
    return (*machine.positions_of(*POSITIONS), *machine.segments, ANGLE)


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        lacks=machine.lacks,
        roles=("levitation", "rotation"),
        channels=(*channels(machine), STATUS),
        sensors=(*machine.segments, *machine.positions_of("yi", "yo", "xi", "xo")),
        parameters=needed(rig, *NEEDED),
        geometry=GEOMETRY,
        machine=("pole_pairs",),
        capabilities=("lift_time", "settings.lifted_by", "settings.sharing", f"status.contact.{machine.bearings[1]}"),
    )
