"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from collections.abc import Mapping

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from bench.rigfile.stage import StageAxis, axes_of

COUNTER = "without one outside the loop only the repeatability of a counter could be told, and that is no accuracy"
NONE = f"capabilities.reference: found no reference instrument of an axis; {COUNTER}"


def readable(rig: RigFile) -> Mapping[str, StageAxis]:
    """Axes that are positioned and read by a reference instrument, by name."""
    return {name: axis for name, axis in axes_of(rig).items() if name in rig.capabilities.reference}


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
