"""From recorded levels to where the shaft came to rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from procedures.map_zero.approaches import Approach, approaches
from procedures.map_zero.plan import Plan
from procedures.stages.stators import axis

Array = npt.NDArray[np.float64]
LEVEL = "level"


@dataclass(frozen=True)
class Rest:
    """Of one approach at one `level` A: what the encoders read, rad and m, how far the angle went meanwhile, the current as it
    is read, `states` of the controller."""

    approach: Approach
    level: float
    angle: float
    x: float
    went: float
    current: float
    states: tuple[str, ...]
    lost: int
    expected: int


def read_rests(recording: Recording[Plan]) -> list[Rest]:
    """In time order."""
    known = {a.number: a for a in approaches(recording.rig, recording.plan)}
    return [_rest(recording, step, known[int(step.labels["number"])]) for step in recording.steps(LEVEL)]


def _rest(recording: Recording[Plan], step: Step, approach: Approach) -> Rest:
    rig, names = recording.rig, recording.rig.choices(STATE)
    x, angle = axis(rig, "stroke"), axis(rig, "angle")
    assert x is not None
    assert angle is not None
    data = step.read(x.channel, angle.channel, approach.phase.current, STATE)
    return Rest(
        approach, float(step.labels["level"]), float(data[angle.channel].mean()), float(data[x.channel].mean()),
        float(np.ptp(data[angle.channel])), float(data[approach.phase.current].mean()),
        tuple(names.get(int(code), str(int(code))) for code in np.unique(data[STATE])), step.lost(), step.expected(),
    )  # fmt: skip
