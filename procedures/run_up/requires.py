"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from dataclasses import replace

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from procedures.amb_rotor.conventions import conventions
from procedures.unbalance import requires as unbalance


def requires(rig: RigFile) -> Requires:
    """What the unbalance response needs; the greatest coil voltage of each bearing is shown where it is told."""
    needed, told = unbalance.requires(rig), conventions(rig).plane_voltages
    return replace(needed, channels=(*needed.channels, *told), uses=(*needed.uses, "flatness", "gains"))
