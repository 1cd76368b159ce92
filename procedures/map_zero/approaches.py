"""From which side which phase draws the shaft in, and by which currents."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bench.rigfile import RigFile
from procedures.map_zero.plan import Plan
from procedures.stages.stators import Phase, phases, poles


@dataclass(frozen=True)
class Approach:
    """A phase draws tooth number `tooth` in from `side` (-1 below, 1 above) of the angle `aligned`, rad."""

    phase: Phase
    tooth: int
    side: int
    aligned: float
    number: int

    @property
    def name(self) -> str:
        """As findings name it."""
        return f"{self.phase.name}, {math.degrees(self.aligned):.4g}°, from {'above' if self.side > 0 else 'below'}"


def approaches(rig: RigFile, plan: Plan) -> tuple[Approach, ...]:
    """Phase by phase and tooth by tooth, from both sides: the side that comes first changes, so that what drifts counts for
    neither."""
    out: list[Approach] = []
    pitch = 2 * math.pi / max(poles(rig), 1)
    for phase in phases(rig):
        for tooth in plan.teeth:
            at = (phase.aligned + tooth * pitch) % (2 * math.pi)
            for side in (1, -1) if (tooth + phase.stator) % 2 else (-1, 1):
                out.append(Approach(phase, tooth, side, at, len(out)))
    return tuple(out)


def ramp(plan: Plan) -> list[tuple[float, bool]]:
    """Currents one after the other, A, and whether the shaft is read there: each level is reached by steps from below."""
    out: list[tuple[float, bool]] = []
    now = plan.first_A
    for level in sorted(plan.levels_A):
        while now * plan.growth < level:
            out.append((now, False))
            now *= plan.growth
        out.append((level, True))
        now = level * plan.growth
    return out
