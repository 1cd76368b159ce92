"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from bench.rigfile.stage import axes_of
from procedures.axis_breakaway.sequence import INTEGRATORS, loads


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    axes = axes_of(rig).values()
    lacks = [f"capabilities.positioning.axes.{a.name}: found no {part}" for a in axes for part in ("asked", "rate")
             if not getattr(a, part)]  # fmt: skip
    lacks += [f"hooks, levers: found none that pull {a.name} both ways" for a in axes if not loads(rig, a)]
    return Requires(
        roles=("motion", "operator"),
        channels=(*(a.channel for a in axes), STATE) if axes else (),
        capabilities=("positioning", f"settings.{INTEGRATORS}"),
        masses=True,
        lacks=tuple(lacks),
    )
