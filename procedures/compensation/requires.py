"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from dataclasses import replace

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.recorded import AGE, COUNT
from procedures.amb_rotor.conventions import conventions
from procedures.unbalance import requires as unbalance


def requires(rig: RigFile) -> Requires:
    """What the unbalance response needs, and a controller that compensates."""
    needed, machine = unbalance.requires(rig), conventions(rig)
    return replace(
        needed, capabilities=(*needed.capabilities, "settings.compensation.corrected", "settings.compensation.waiting"),
        capture=(*needed.capture, *machine.positions, *(machine.pulsed or (COUNT, AGE))),
    )  # fmt: skip
