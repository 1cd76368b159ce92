"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE, SPEED, STATUS
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.step import capturing
from procedures.step.probes import is_plain


def channels(machine: AmbRotor) -> tuple[str, ...]:
    """What is read of a step."""
    return (*capturing.channels(machine), *marked(machine), STATUS)


def marked(machine: AmbRotor) -> tuple[str, ...]:
    """Roles that tell how the shaft turns, where the rig has them."""
    return (ANGLE, SPEED) if machine.marked else ()


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    read = channels(machine)
    return Requires(
        lacks=machine.lacks if is_plain(rig) else (*machine.lacks, *machine.stations.lacks),
        channels=read,
        sensors=capturing.channels(machine),
        capabilities=("set_points",),
        uses=(
            "settings.law",
            "gains",
            "bias",
            "model",
            "mark",
            *(["capture"] if capturing.captures(rig, machine) else []),
        ),
    )
