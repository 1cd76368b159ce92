"""From recorded turns to arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from procedures.position_loops.lines import unwound
from procedures.runout_map.plan import Plan
from procedures.runout_map.planes import planes

Array = npt.NDArray[np.float64]
TURN = "turn"


@dataclass(frozen=True)
class Turned:
    """One turn at `place` m along, `sign` 1 or -1: times s, angles rad and channels (n,) on whole turn; what the place read,
    `stood` m; `states` of the controller, samples `lost` of those `expected`."""

    place: float
    sign: int
    repeat: int
    times: Array
    angle: Array
    channels: Mapping[str, Array]
    stood: float
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it."""
        return f"{self.place * 1e3:.4g} mm, {'up' if self.sign > 0 else 'down'}, {self.repeat + 1}"


def read_turns(recording: Recording[Plan]) -> list[Turned]:
    """Every turn, in time order."""
    return [_turned(recording, step) for step in recording.steps(TURN)]


def _turned(recording: Recording[Plan], step: Step) -> Turned:
    motion, names = recording.rig.capabilities.motion, recording.rig.choices(STATE)
    assert motion is not None
    wanted = [c for p in planes(recording.rig) for c in (*p.positions, *p.currents)]
    data = step.read(motion.angle_channel, motion.place_channel, STATE, *wanted)
    angle = np.asarray(data[motion.angle_channel], np.float64)
    if angle.size:
        angle = unwound(angle, math.pi)
    on = (angle >= 0) & (angle < 2 * math.pi)
    return Turned(
        place=float(step.labels["place_m"]),
        sign=int(step.labels["way"]),
        repeat=int(step.labels["repeat"]),
        times=(data["t_ns"][on] - step.start_ns) * 1e-9,
        angle=angle[on],
        channels={c: np.asarray(data[c][on], np.float64) for c in wanted},
        stood=float(np.mean(data[motion.place_channel])) if angle.size else math.nan,
        states=tuple(names.get(int(code), str(int(code))) for code in np.unique(data[STATE])),
        lost=step.lost(),
        expected=step.expected(),
    )
