"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from bench.rigfile.stage import axes_of
from procedures.stages.pairs import lacks


def requires(rig: RigFile) -> Requires:
    """A stage with two axes or more that play waves."""
    axes = axes_of(rig).values()
    if not axes:
        return Requires(roles=("motion",), capabilities=("positioning",))
    return Requires(
        roles=("motion",), capabilities=("positioning",),
        channels=(*(c for a in axes for c in (a.channel, a.reference, a.asked) if c), STATE),
        uses=("settings.integrators",), lacks=tuple(lacks(rig)),
    )  # fmt: skip
