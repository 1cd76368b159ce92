"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.gate_margin.place import captured
from procedures.position_loops.movers import motion, radial


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    if rig.capabilities.motion is None:
        return Requires(capabilities=("motion",), capture=())
    at, probes = motion(rig), radial(rig)
    return Requires(
        channels=(*probes.values(), at.place_channel, STATE),
        capabilities=("motion", "motion.gate", "motion.gate_time"),
        capture=captured(rig),
        uses=("settings.observer", "hold", "loop_injection"),
        lacks=() if probes else ("probes: found none across the shaft; expected the radial ones",),
    )
