"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import SPEED, STATUS
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor


def upper_and_lower(machine: AmbRotor) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Channels of the currents in the coils that carry the weight, and in those below."""
    upper, lower = zip(*map(machine.pair, machine.axes), strict=True)
    return upper, lower


def channels(machine: AmbRotor) -> tuple[str, ...]:
    """What is read of an orbit."""
    upper, lower = upper_and_lower(machine)
    return (*machine.stations.channels, *upper, *lower, *((SPEED,) if machine.speed_told else ()), STATUS)


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    whole = machine.stations.channels
    by_path = machine.lacks if machine.can.path is not None else ()
    return Requires(
        channels=channels(machine), sensors=(*whole, *machine.currents), capabilities=("set_points",),
        lacks=(*machine.stations.lacks, *machine.unmoved(("y", "z", "theta")), *by_path),
        uses=("path", "settings.law", "settings.compensation", "model", "mark"),
    )  # fmt: skip
