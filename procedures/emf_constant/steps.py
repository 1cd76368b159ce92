"""Labels of what is recorded, and from a recording to moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from procedures.emf_constant.fit import Move, averaged
from procedures.emf_constant.moves import captured, held, windings
from procedures.emf_constant.plan import Plan

MOVE = "move"


@dataclass(frozen=True)
class Taken:
    """A move `there` (1) or back (-1) for a motor: what its capture holds, None where there is none; `states` of the controller
    meanwhile, samples of the telemetry `lost` of those `expected`."""

    motor: str
    repeat: int
    there: int
    move: Move | None
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it."""
        return f"{self.motor}, repeat {self.repeat + 1}, {'there' if self.there > 0 else 'back'}"


def read_taken(recording: Recording[Plan]) -> list[Taken]:
    """Every move, in time order."""
    return [_taken(recording, step) for step in recording.steps(MOVE)]


def _taken(recording: Recording[Plan], step: Step) -> Taken:
    rig, labels = recording.rig, step.labels
    codes, names = step.read(STATE)[STATE], rig.choices(STATE)
    states = tuple(names.get(int(code), str(int(code))) for code in np.unique(codes))
    motor, found, move = str(labels["motor"]), recording.captures(number=labels["number"]), None
    if found and found[0].samples > 1:
        one, data = windings(rig)[motor], found[0].arrays(*captured(rig, motor))
        voltages, currents = (np.array([data[c] for c in names]) for names in (one.voltages.values(), one.coils))
        move = averaged(data["t_s"], data[one.channel], voltages, currents, held(rig, recording.plan))
    return Taken(motor, int(labels["repeat"]), int(labels["there"]), move, states, step.lost(), step.expected())
