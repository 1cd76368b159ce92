"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from bench.rigfile.stage import axes_of
from procedures.axis_inertia.plan import Plan
from procedures.axis_inertia.sequence import known, plays


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    able = [a for a in axes_of(rig).values() if plays(a)]
    if axes_of(rig) and not able:
        return Requires(roles=("motion",), capabilities=("positioning",),
                        lacks=("capabilities.positioning.axes: found no wave with a sine",))  # fmt: skip
    return Requires(
        roles=("motion",),
        channels=(*(a.channel for a in able), STATE) if able else (),
        machine=tuple(dict.fromkeys(known(a, Plan.model_validate({})) for a in able)),
        capabilities=("positioning",),
    )
