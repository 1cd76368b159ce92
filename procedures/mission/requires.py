"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.errors import Lacking
from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_loops import Motion


def motion(rig: RigFile) -> Motion:
    """How the mover is sent.

    Raises:
        Lacking: the rig file does not say.
    """
    found = rig.capabilities.motion
    if found is None:
        raise Lacking("capabilities: found no motion")
    return found


def radial(rig: RigFile) -> dict[str, str]:
    """Channels of the probes that look across the shaft, by the probes' names."""
    return {name: probe.channel for name, probe in rig.probes.items() if probe.direction is not None}


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
