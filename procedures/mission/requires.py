"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from procedures.position_loops.movers import motion, radial


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    if rig.capabilities.motion is None:
        return Requires(capabilities=("motion", "settings.observer"))
    at = motion(rig)
    probes = radial(rig)
    lacks = () if probes else ("probes: found none across the shaft; expected the radial ones",)
    return Requires(
        channels=(*probes.values(), at.place_channel, at.angle_channel),
        sensors=(*probes.values(), at.place_channel),
        capture=(*probes.values(), at.place_channel, at.angle_channel, *at.currents),
        capabilities=("motion", "settings.observer", "motion.gate", "motion.gate_time"),
        lacks=lacks,
    )
