"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATUS
from procedures.estimator_compare.steps import ENGAGE, captured
from procedures.one_axis.conventions import conventions


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        roles=("levitation", "operator"),
        channels=(machine.position, STATUS),
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
