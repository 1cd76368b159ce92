"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE, STATUS
from procedures.servomotor import hold, wiring
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.parameters import needed

NEEDED = ("motor.sine", "motor.sine_hz", "motor.ramp", "motor.share", "motor.allocation", "angle.low_pass_hz",
          "angle.derivative_on_error")  # fmt: skip


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded of a swing."""
    return (ANGLE, *machine.segments, STATUS)


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        lacks=machine.lacks,
        roles=("levitation", "rotation"),
        channels=(*channels(machine), *wiring.channels(machine)),
        parameters=needed(rig, *hold.NEEDED, *wiring.needs(rig), *NEEDED, "motor.segment_limit"),
        machine=("polar_inertia",),
    )
