"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from procedures.synchronous.dwells import required


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    return required(rig)
