"""From recorded sines and added currents to arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.actuator_constant.plan import Plan
from procedures.position_loops.injection import ability
from procedures.position_loops.lines import without_trend
from procedures.position_loops.motors import motors

Array = npt.NDArray[np.float64]
SINE, ADDED = "sine", "added"


def with_ring(place: str) -> str:
    """What a place is called where the ring is on."""
    return f"{place} with the ring"


@dataclass(frozen=True)
class Common:
    """Of any step: the loop, what the place is called, share of the telemetry's samples in which the loop was `limited`, the
    `states` that the controller was in, samples `lost` of those `expected`; `ring`: with the ring on."""

    loop: str
    place: str
    limited: float
    states: tuple[str, ...]
    lost: int
    expected: int
    ring: bool = False

    @property
    def at(self) -> str:
        """The place, and that the ring is on."""
        return with_ring(self.place) if self.ring else self.place


@dataclass(frozen=True)
class Taken:
    """A sine: at `hz` so many `periods` of `amplitude` m or rad; captured `position` (n,) and `currents` by motor (n,): empty
    where it was not captured; `coils` by motor, amplitude and sign of each of its coils' readings along the motor's own
    current, A, and `said`, that current's amplitude with its standard uncertainty: empty but for one sine of a place; `wave`,
    the captured sine's amplitude as a share (NaN: not captured)."""

    common: Common
    hz: float
    amplitude: float
    periods: int
    position: Array
    currents: Mapping[str, Array]
    coils: Mapping[str, Array]
    said: Mapping[str, tuple[float, float]]
    wave: float

    @property
    def where(self) -> str:
        """As findings name it."""
        return f"{self.common.loop}, {self.common.at}, {self.hz:.4g} Hz"


@dataclass(frozen=True)
class Added:
    """A current added to that of one motor: means at rest of the `position` and of the `currents` by motor."""

    common: Common
    size: float
    position: float
    currents: Mapping[str, float]


def channels(rig: RigFile, loop: str, whole: bool) -> tuple[str, ...]:
    """What is captured of a sine; `whole`: the coils, too."""
    can, driving = ability(rig), motors(rig, loop)
    coils = [c for name in driving for c in rig.motors[name].currents] if whole else []
    currents = [one.current for one in driving.values()]
    return tuple(dict.fromkeys([can.loops[loop].channel, *currents, *coils, *([can.wave] if can.wave else [])]))


def _common(recording: Recording[Plan], step: Step) -> Common:
    loop = str(step.labels["loop"])
    limited, names = ability(recording.rig).loops[loop].limited, recording.rig.choices(STATE)
    data = step.read(STATE, *([limited.channel] if limited is not None else []))
    share = 0.0
    if limited is not None and len(data[STATE]):
        flags = data[limited.channel].astype(np.int64)
        share = float(np.mean(flags != 0 if limited.mask is None else flags & limited.mask != 0))
    states = tuple(names.get(int(code), str(int(code))) for code in np.unique(data[STATE]))
    ring = bool(step.labels.get("ring", False))
    return Common(loop, str(step.labels["place"]), share, states, step.lost(), step.expected(), ring)


def read_taken(recording: Recording[Plan]) -> list[Taken]:
    """Every sine, in time order."""
    return [_taken(recording, step) for step in recording.steps(SINE)]


def _taken(recording: Recording[Plan], step: Step) -> Taken:
    rig, labels, common = recording.rig, step.labels, _common(recording, step)
    can, driving = ability(rig), motors(rig, common.loop)
    n, periods = int(labels["samples"]), int(labels["periods"])
    captured = recording.captures(number=labels["number"])
    facts = (float(labels["hz"]), float(labels["amplitude"]), periods)
    if not captured:
        return Taken(common, *facts, np.empty(0), {}, {}, {}, float("nan"))
    whole = bool(labels["whole"])
    data = captured[0].arrays(*channels(rig, common.loop, whole))
    currents = {name: data[one.current][:n] for name, one in driving.items()}
    coils, said = {}, {}
    for name in driving if whole else ():
        along, left = without_trend(currents[name], periods)
        each = np.array([without_trend(data[c][:n], periods)[0] for c in rig.motors[name].currents])
        said[name] = abs(along), math.sqrt(2 / n * float(np.mean(left**2)))
        coils[name] = (each * np.conj(along)).real / max(abs(along), 1e-300)
    wave = abs(without_trend(data[can.wave][:n], periods)[0]) if can.wave else float("nan")
    return Taken(common, *facts, data[can.loops[common.loop].channel][:n], currents, coils, said, wave)


def read_added(recording: Recording[Plan]) -> list[Added]:
    """Every added current, in time order."""
    out = []
    for step in recording.steps(ADDED):
        common = _common(recording, step)
        position = step.mean(ability(recording.rig).loops[common.loop].channel)
        currents = {name: step.mean(one.current) for name, one in motors(recording.rig, common.loop).items()}
        out.append(Added(common, float(step.labels["size_A"]), position, currents))
    return out
