"""How a mover is sent along and around, and the probes that look across it."""

from __future__ import annotations

from bench.errors import Lacking
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
