"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from procedures.amb_rotor.conventions import conventions
from procedures.tracking.steps import channels


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
