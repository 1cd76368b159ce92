"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from procedures.stages import tracks


def requires(rig: RigFile) -> Requires:
    """As any positioned stage."""
    return tracks.requires(rig)
