"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from dataclasses import replace

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from procedures.balance import planes
from procedures.synchronous.dwells import required


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    needed = required(rig)
    return replace(needed, lacks=(*needed.lacks, *planes.missing(rig)),
                   uses=(*needed.uses, "bias", "gains", "model", "flatness"))  # fmt: skip
