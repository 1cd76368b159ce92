"""What a nameplate's flux may be meant of: the flux of a coil or of what is in series, its peak or its root mean square."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, interval
from procedures.emf_constant.moves import Winding
from procedures.emf_constant.plan import Plan

PHASES = 3


@dataclass(frozen=True)
class Nameplate:
    """What the `printed` flux, Wb, is of the measured one of a coil, `ratio` with `share_U`, U of it; the convention
    `nearest` to it, how far off it is as a share, and whether it `fits`."""

    printed: float
    parameter: str
    ratio: float
    share_U: float
    nearest: str
    off: float
    fits: bool


def conventions(coils: int) -> dict[str, float]:
    """By what a flux may be meant of, how many times that of a coil at its peak it is, for a motor of so many coils."""
    series = coils / PHASES
    out = {"a coil, peak": 1.0, "a coil, rms": 1 / math.sqrt(2)}
    if series != 1:
        out |= {
            f"a phase of {series:g} coils, peak": series,
            f"a phase of {series:g} coils, rms": series / math.sqrt(2),
        }
    return out | {"line to line, peak": series * math.sqrt(3)}


def compared(winding: Winding, flux: Estimate, rig: RigFile, plan: Plan) -> Nameplate | None:
    """None where the rig file has no nameplate's flux."""
    name = rig.capabilities.force_currents[winding.motor].flux
    if name not in rig.parameters or not flux.value > 0:
        return None
    i, printed = interval(flux), rig.parameters[name].default
    ratio, share = printed / flux.value, (i.high - i.low) / 2 / flux.value
    known = conventions(len(winding.coils))
    nearest = min(known, key=lambda k: abs(math.log(max(ratio, 1e-300) / known[k])))
    off = ratio / known[nearest] - 1
    return Nameplate(printed, name, ratio, share, nearest, off, abs(off) <= plan.nameplate_share + share)
