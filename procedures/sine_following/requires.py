"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from procedures.stages import tracks
from procedures.stages.tracks import chosen


def requires(rig: RigFile) -> Requires:
    """A positioned stage whose controller gives sines."""
    found = tracks.requires(rig, ("wave",))
    lacks = [f"capabilities.positioning.axes.{a.name}.wave: found no sine" for a in chosen(rig, "all")
             if a.wave is not None and a.wave.sine is None]  # fmt: skip
    return Requires(found.roles, found.channels, capabilities=found.capabilities, uses=found.uses,
                    lacks=(*found.lacks, *lacks))  # fmt: skip
