"""Places over which measurements of a stage's axis are spread: where the other axes stand meanwhile."""

from __future__ import annotations

import math

from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis, axes_of

TWELFTHS = 15  # of a turn over all repeats, at least


def turns(axis: StageAxis) -> bool:
    """Whether it is an axis in rad."""
    return axis.unit == "rad"


def others(rig: RigFile, axis: StageAxis) -> tuple[StageAxis, ...]:
    """All axes but one."""
    return tuple(a for a in axes_of(rig).values() if a.name != axis.name)


def middle(axis: StageAxis) -> float:
    """Of the travel; 0 where it has no end."""
    return (axis.low + axis.high) / 2 if math.isfinite(axis.high - axis.low) else 0.0


def spread(repeats: int) -> float:
    """Turns over so many repeats: twelfths that have no divisor in common with them, so that neither a turn nor a quarter nor a
    twelfth of one comes again, and places lie evenly over each (a rotor of four poles in three phases is alike by these)."""
    each = TWELFTHS
    while math.gcd(each, repeats) > 1:
        each += 1
    return each / 12


def stands(axis: StageAxis, repeat: int, repeats: int, half_m: float) -> float:
    """Where an axis stands in one of so many repeats: around, or up to `half_m` to each side of the middle."""
    if turns(axis):
        return 2 * math.pi * spread(repeats) * repeat / repeats
    return middle(axis) + half_m * (2 * (repeat + 0.5) / repeats - 1)
