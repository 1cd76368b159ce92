"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from bench.rigfile.stage import axes_of


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    axes = axes_of(rig).values()
    lacks = [f"capabilities.positioning.axes.{a.name}: found no {part}" for a in axes for part in ("asked", "rate")
             if not getattr(a, part)]  # fmt: skip
    return Requires(
        roles=("motion",),
        channels=(*(a.channel for a in axes), STATE) if axes else (),
        capabilities=("positioning",),
        lacks=tuple(lacks),
    )
