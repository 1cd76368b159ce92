"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE, STATUS
from procedures.load_balancing import inputs
from procedures.servomotor import hold, wiring
from procedures.servomotor.conventions import LOADS, PHASE, Servomotor, conventions
from procedures.servomotor.parameters import needed
from procedures.shared.unsupported import of_motors

NEEDED = ("motor.share", "motor.share_slew", "motor.segment_limit", "motor.ramp", "motor.phase", "motor.phase_slew",
          "motor.phase_limit", "motor.circle", "motor.circle_hz", "angle.ref")  # fmt: skip


def positions(machine: Servomotor) -> tuple[str, ...]:
    """Where the end is that goes around."""
    return machine.positions_of("xo", "yo")


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded of a turn."""
    return (*positions(machine), *machine.segments, ANGLE, STATUS)


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        lacks=(*machine.lacks, *of_motors(rig)),
        roles=("levitation", "rotation"),
        channels=(*channels(machine), *wiring.channels(machine)),
        sensors=(*machine.segments, *positions(machine)),
        parameters=needed(rig, *hold.NEEDED, *wiring.NEEDED, *NEEDED),
        geometry=tuple(inputs.LENGTHS.values()),
        machine=("pole_pairs",),
        capture=(PHASE, *LOADS),
        capabilities=(
            "settings.sharing", "settings.load_balancing", "model.alpha_d", "model.alpha_c", "model.stiffness",
        ),
    )  # fmt: skip
