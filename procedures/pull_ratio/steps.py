"""From recorded levels to arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.pull_ratio.plan import Plan
from procedures.pull_ratio.planes import BOTH, Level, angles, axes, captured, currents, loop, planes, positions

Array = npt.NDArray[np.float64]
STEP = "level"


@dataclass(frozen=True)
class Taken:
    """One level: mean `readings` m (None where it was not captured) and `currents` A in the order of the planes, as they are
    read, and `angles` by channel. How far a reading is `off` its set point at most, m. `limited`: the
    share of the telemetry at a loop's limit; states, samples lost and expected."""

    level: Level
    readings: Array | None
    currents: Array
    angles: dict[str, float]
    off: float
    limited: float
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it."""
        one = self.level
        moved = f"both planes along {one.axis}" if one.moved == BOTH else one.moved
        return f"{moved} at {one.level_m * 1e6:+g} µm from {'below' if one.branch > 0 else 'above'}"


def read_taken(recording: Recording[Plan]) -> list[Taken]:
    """Every level, in time order."""
    return [_taken(recording, step) for step in recording.steps(STEP)]


def _taken(recording: Recording[Plan], step: Step) -> Taken:
    rig, labels = recording.rig, step.labels
    one = Level(str(labels["axis"]), str(labels["moved"]), float(labels["level_m"]), int(labels["branch"]))
    names, told = rig.choices(STATE), step.read(STATE, *_flags(rig))
    states = tuple(names.get(int(code), str(int(code))) for code in np.unique(told[STATE]))
    ends = (_limited(rig, told), states, step.lost(), step.expected())
    found = recording.captures(number=labels["number"])
    if not found:
        return Taken(one, None, np.empty(0), {}, 0.0, *ends)
    data = {name: float(x.mean()) for name, x in found[0].arrays(*captured(rig)).items()}
    readings = np.array([data[c] for c in positions(rig)])
    wanted = np.array([_set_point(rig, one, name) for p in planes(rig) for name in p.loops])
    off = float(np.abs(readings - wanted).max())
    return Taken(
        one, readings, np.array([data[c] for c in currents(rig)]), {c: data[c] for c in angles(rig)}, off, *ends
    )


def _set_point(rig: RigFile, one: Level, name: str) -> float:
    if name not in axes(rig)[one.axis]:
        return 0.0
    return one.level_m if one.moved in (BOTH, name) else 0.0


def _flags(rig: RigFile) -> tuple[str, ...]:
    bits = [loop(rig, name).limited for p in planes(rig) for name in p.loops]
    return tuple(dict.fromkeys(bit.channel for bit in bits if bit is not None))


def _limited(rig: RigFile, told: dict[str, npt.NDArray[np.float64]]) -> float:
    share = 0.0
    for p in planes(rig):
        for name in p.loops:
            bit = loop(rig, name).limited
            if bit is not None and len(told[bit.channel]):
                flags = told[bit.channel].astype(np.int64)
                share = max(share, float(np.mean(flags != 0 if bit.mask is None else flags & bit.mask != 0)))
    return share
