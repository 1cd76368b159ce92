"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATUS
from procedures.one_axis.conventions import HARMONIC, LOAD, OneAxis, conventions

ENGAGE, HANG = "engage", "hang"


def captured(machine: OneAxis, kind: str) -> tuple[str, ...]:
    """What is captured."""
    return (*machine.captured, *((LOAD, HARMONIC, *machine.currents) if kind == ENGAGE else ()))


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        roles=("levitation", "operator"),
        channels=(machine.position, STATUS),
        sensors=(machine.position,),
        capabilities=(
            "settings.estimator",
            "settings.compensation",
            "model.harmonic_hz",
            "model.degree",
            "model.window",
            "model.rule",
        ),
        capture=captured(machine, ENGAGE),
        masses=True,
    )
