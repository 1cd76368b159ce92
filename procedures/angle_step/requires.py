"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE, STATUS
from procedures.angle_step import bounds
from procedures.servomotor import hold, wiring
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.parameters import needed

NEEDED = (
    "motor.share",
    "motor.share_slew",
    "motor.allocation",
    "motor.segment_limit",
    "motor.ramp",
    "angle.low_pass_hz",
    "angle.derivative_on_error",
    "angle.slew",
)


def positions(machine: Servomotor) -> tuple[str, ...]:
    """Where the shaft is, inboard first."""
    return machine.positions_of("xi", "yi", "xo", "yo")


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded of a step."""
    return (ANGLE, *positions(machine), *machine.segments, STATUS)


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        lacks=machine.lacks,
        roles=("levitation", "rotation"),
        channels=(*channels(machine), *wiring.channels(machine)),
        sensors=(*positions(machine), *(machine.segments if bounds.bounded(rig) else ())),
        parameters=needed(rig, *hold.NEEDED, *wiring.needs(rig), *NEEDED),
        uses=("capture",),
        machine=("polar_inertia",),
    )
