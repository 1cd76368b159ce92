"""What a rig file says of how fast the loops that hold a shaft are.

A reading is answered by a reference one tick later, and by the current after that as an amplifier of the first order makes it.
`loop_delay` of a rig file is both together (docs/reference/rig-file.md), the lag is the amplifier's part alone.
"""

from __future__ import annotations

import math

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced

SLOWEST_S = 6e-4  # of a current loop of 265 Hz; a slower one leaves a magnetic bearing's loop no phase
DELAY = "capabilities/loop_delay"


def lag_s(rig: RigFile) -> float:
    """By which currents follow their references, s: as the controller knows it, or as the rig file says; else the middle of
    what is possible."""
    can, tick_s = rig.capabilities, rig.devices["controller"].tick_s
    if "rate" in can.model:
        return 1 / rig.parameters[can.model["rate"]].default
    return can.loop_delay.value - tick_s if can.loop_delay is not None else _slowest_s(rig) / 2


def lag_doubt(rig: RigFile) -> Toleranced | None:
    """What is not known of the lag, about 0 s: the tolerance of the rig file's loop delay; where nothing is told all between
    none and the slowest amplifier. None where the controller knows it. Known to budgets as `DELAY`."""
    can = rig.capabilities
    if "rate" in can.model:
        return None
    if can.loop_delay is not None:
        return can.loop_delay.model_copy(update={"value": 0.0})
    half = _slowest_s(rig) / 2
    source = f"no capabilities.loop_delay in the rig file: an amplifier's lag of 0 to {2e3 * half:g} ms"
    return Toleranced(value=0.0, unit="s", u=None, k=1.0, half_width=half, distribution="rectangular", source=source)


def _slowest_s(rig: RigFile) -> float:
    """Where a controller's ticks are long its amplifiers may be slow too."""
    return max(SLOWEST_S, 2 * rig.devices["controller"].tick_s)


def loop_rad_s(rig: RigFile) -> float:
    """The rigid modes' own, rad/s, by the laws that say so (`flatness`: the root of k1); infinite where none does."""
    stiff = [rig.parameters[f.k1].default for f in rig.capabilities.flatness.values()]
    return min(map(math.sqrt, stiff), default=math.inf)
