"""Where the shaft is locked for pulses."""

from __future__ import annotations

import math
from dataclasses import dataclass

from procedures.inductance_map.plan import Plan

GOLDEN = (math.sqrt(5) - 1) / 2
"""Multiples of it fill half a turn, and each quarter, evenly: however many there are, none repeats another."""


@dataclass(frozen=True)
class Place:
    """`x` m and `angle` rad where the shaft is sent."""

    number: int
    x: float
    angle: float

    @property
    def name(self) -> str:
        """As findings name it."""
        return f"{self.x * 1e3:.4g} mm, {math.degrees(self.angle):.4g}°"


def grid(plan: Plan) -> tuple[Place, ...]:
    """Position by position; angles are in one half of the turn and in the other in turn. So each is come to from the other side
    than the one before, and what a loop leaves of the count at which it comes to rest is none in the mean."""
    out = []
    for k in range(len(plan.positions_m) * plan.angles_per_position):
        angle = math.pi * ((k + 1) * GOLDEN % 1.0 + k % 2)
        out.append(Place(k, plan.positions_m[k // plan.angles_per_position], angle))
    return tuple(out)
