"""What a rig file says of how fast the loops that hold a shaft are."""

from __future__ import annotations

import math

from bench.rigfile import RigFile

UNKNOWN_LAG = 4.0  # ticks: an amplifier of some 400 Hz behind a controller of 10 kHz


def lag_s(rig: RigFile) -> float:
    """By which currents follow their references, s: as the controller knows it, or as the rig file says."""
    can = rig.capabilities
    if "rate" in can.model:
        return 1 / rig.parameters[can.model["rate"]].default
    return can.loop_delay_s or UNKNOWN_LAG * rig.devices["controller"].tick_s


def loop_rad_s(rig: RigFile) -> float:
    """The rigid modes' own, rad/s, by the laws that say so (`flatness`: the root of k1); infinite where none does."""
    stiff = [rig.parameters[f.k1].default for f in rig.capabilities.flatness.values()]
    return min(map(math.sqrt, stiff), default=math.inf)
