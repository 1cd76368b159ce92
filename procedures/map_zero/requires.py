"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.stages.stators import POLES, axis, lacks, phases


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    wanted, test = ("positioning", "phase_test"), rig.capabilities.phase_test
    if test is None or rig.capabilities.positioning is None:
        return Requires(roles=("motion",), capabilities=wanted)
    return Requires(
        roles=("motion", "operator"),
        channels=(STATE, *(a.channel for a in (axis(rig, "stroke"), axis(rig, "angle")) if a is not None),
                  *(p.current for p in phases(rig))),
        machine=(POLES,),
        capabilities=wanted,
        lacks=(*lacks(rig), *(() if test.current else ("capabilities.phase_test: found no current",))),
    )  # fmt: skip
