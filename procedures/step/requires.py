"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATUS
from procedures.amb_rotor.conventions import conventions
from procedures.step import capturing
from procedures.step.probes import is_plain
from procedures.step.turning import marked
from procedures.synchronous import mark


def channels(rig: RigFile) -> tuple[str, ...]:
    """What is read of a step."""
    return (*capturing.channels(conventions(rig)), *marked(rig), STATUS)


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    by_edges = not mark.by_angle(rig) and bool(marked(rig))
    read = (*capturing.channels(machine), *(mark.needed(rig) if by_edges else marked(rig)), STATUS)
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
