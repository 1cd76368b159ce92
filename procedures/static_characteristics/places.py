"""Where the shaft is held by load cells, and which readings are taken there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from procedures.inductance_map.places import GOLDEN, Place
from procedures.stages.stators import Phase
from procedures.static_characteristics.plan import Plan

Side = Literal["above", "below"]
SIDES: tuple[Side, Side] = ("above", "below")
NOTHING = ""


@dataclass(frozen=True)
class Load:
    """A phase with a current: the name of the phase, "" for none, its current A, and how often none came before (`turn`)."""

    phase: str
    level: float
    turn: int = 0


def grid(plan: Plan) -> tuple[Place, ...]:
    """Position by position; angles as pulses have them: none repeats another's part of a tooth."""
    count = len(plan.positions_m) * plan.angles_per_position
    angles = [math.pi * ((k + 1) * GOLDEN % 1.0 + k % 2) for k in range(count)]
    return tuple(Place(k, plan.positions_m[k // plan.angles_per_position], a) for k, a in enumerate(angles))


def loads(plan: Plan, some: Sequence[Phase]) -> Iterator[Load]:
    """At each place: nothing, all phases at all currents, and nothing again, by which zeros that wander are known."""
    yield Load(NOTHING, 0.0, 0)
    for phase in some:
        yield from (Load(phase.name, level) for level in plan.levels_A)
    yield Load(NOTHING, 0.0, 1)


def repeated(plan: Plan, some: Sequence[Phase]) -> tuple[int, ...]:
    """Numbers of the loads that are read again at the last place of a run that was stopped: nothing, all phases at the greatest
    current, and nothing again."""
    per = len(plan.levels_A)
    return (0, *(per * (k + 1) for k in range(len(some))), per * len(some) + 1)
