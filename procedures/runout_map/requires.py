"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.runout_map.planes import planes


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    motion, of = rig.capabilities.motion, planes(rig)
    if motion is None or rig.capabilities.hold is None:
        return Requires(capabilities=("hold", "motion"))
    lacks = [] if of else ["capabilities.hold.axes: found none of two axes, or no [shaft]"]
    return Requires(
        channels=(
            motion.angle_channel,
            motion.place_channel,
            STATE,
            *(c for p in of for c in (*p.positions, *p.currents)),
        ),
        sensors=tuple(c for p in of if p.motor for c in rig.motors[p.motor].currents),
        capabilities=("hold", "motion"),
        lacks=tuple(lacks),
    )
