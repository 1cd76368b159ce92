"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATUS
from procedures.servomotor import hold, wiring
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.parameters import BIASES, needed
from procedures.shared.unsupported import of_motors

NEEDED = ("motor.ramp", *BIASES, "at.xi", "at.yi", "at.xo", "at.yo")
GEOMETRY = ("amb_span", "motor_to_outboard_amb", "amb_gap", "lever_left", "lever_right")


def positions(machine: Servomotor) -> tuple[str, ...]:
    """Where the shaft is, inboard first."""
    return machine.positions_of("xi", "yi", "xo", "yo")


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded at a point, besides the flags."""
    return (*machine.coils["yi"], *positions(machine), *machine.segments)


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        lacks=(*machine.lacks, *of_motors(rig)),
        roles=("levitation", "rotation"),
        channels=(*channels(machine), STATUS, *wiring.channels(machine)),
        sensors=(*machine.coils["yi"], *machine.segments, *positions(machine)),
        parameters=needed(rig, *hold.NEEDED, *wiring.NEEDED, *NEEDED),
        geometry=GEOMETRY,
        machine=("pole_pairs",),
        masses=True,
    )
