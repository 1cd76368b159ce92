"""Where the shaft is locked for pulses."""

from __future__ import annotations

import math
from dataclasses import dataclass

from procedures.inductance_map.plan import Plan

GOLDEN = (math.sqrt(5) - 1) / 2
"""Multiples of it fill a turn, and each quarter of it, evenly: however many there are, none repeats another."""
TAU = 2 * math.pi


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
    """Position by position; angles jump to and fro over the turn, so that they are not all come to from one side."""
    out = []
    for k in range(len(plan.positions_m) * plan.angles_per_position):
        out.append(Place(k, plan.positions_m[k // plan.angles_per_position], TAU * ((k + 1) * GOLDEN % 1.0)))
    return tuple(out)
