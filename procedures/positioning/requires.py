"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.positioning.way import readable

COUNTER = "without one outside the loop only the repeatability of a counter could be told, and that is no accuracy"
NONE = f"capabilities.reference: found no reference instrument of an axis; {COUNTER}"


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    if rig.capabilities.positioning is None:
        return Requires(roles=("motion",), capabilities=("positioning",))
    some = readable(rig)
    asked = any(not rig.capabilities.reference[name].channel for name in some)
    return Requires(
        roles=("motion", "operator") if asked else ("motion",),
        channels=(STATE, *(axis.channel for axis in some.values())),
        capabilities=("positioning", "reference") if some else ("positioning",),
        lacks=() if some else (NONE,),
    )
