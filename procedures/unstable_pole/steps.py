"""From recorded shots to arrays: readings and currents of each axis while they are held, and how the catch ended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.unstable_pole.hold import ability, captured, currents
from procedures.unstable_pole.plan import Plan

Array = npt.NDArray[np.float64]
STEP = "shot"
CAUGHT_S = 2e-3  # at a capture's end: where the shaft is then


@dataclass(frozen=True)
class Taken:
    """One shot: which axis was pushed and by how much, A; samples every `step_s`, by axis u and d (n, 2) m while the currents
    are held and `held`, their means (p,) A in the order of all; how the currents moved meanwhile, `moved` A; what was `seen` of
    it: samples of the hold in all, whether it ended `early`; `caught` m, the farthest reading at the capture's end; states,
    samples lost and expected."""

    number: int
    axis: str
    push: float
    step_s: float
    z: dict[str, Array]
    held: Array
    moved: float
    seen: int
    early: bool
    farthest: float
    caught: float
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it."""
        return f"shot {self.number}, {self.axis} {self.push:+g} A"


def read_taken(recording: Recording[Plan]) -> list[Taken]:
    """Every shot, in time order; of one without capture nothing was seen."""
    return [_taken(recording, step) for step in recording.steps(STEP)]


def _taken(recording: Recording[Plan], step: Step) -> Taken:
    rig, plan, labels = recording.rig, recording.plan, step.labels
    names = rig.choices(STATE)
    codes = np.unique(step.read(STATE)[STATE])
    states = tuple(names.get(int(code), str(int(code))) for code in codes)
    told = (int(labels["number"]), str(labels["axis"]), float(labels["push_A"]))
    ends = (states, step.lost(), step.expected())
    found = recording.captures(number=labels["number"])
    if not found:
        return Taken(*told, 0.0, {}, np.empty(0), 0.0, 0, False, np.nan, np.nan, *ends)
    data, step_s = found[0].arrays(*captured(rig)), 1 / found[0].rate_hz
    on = np.flatnonzero(data[ability(rig).held] > 0.5)
    skip = round(plan.skip_s / step_s)
    used = on[skip : max(len(on) - plan.trim, skip)]
    z = {name: readings(rig, data, name)[used] for name in ability(rig).axes}
    all_currents = np.column_stack([data[c][used] for c in currents(rig)])
    half = len(used) // 2
    moved = float(np.abs(all_currents[half:].mean(axis=0) - all_currents[:half].mean(axis=0)).max()) if half else 0.0
    radial = np.abs(np.column_stack([data[c] for axis in ability(rig).axes.values() for c in axis.positions]))
    tail = round(CAUGHT_S / step_s)
    held = all_currents.mean(axis=0) if len(used) else np.empty(0)
    return Taken(*told, step_s, z, held, moved, len(on), len(on) < round(plan.hold_s / step_s), float(radial.max()),
                 float(radial[-tail:].max()), *ends)  # fmt: skip


def readings(rig: RigFile, data: dict[str, Array], axis: str) -> Array:
    """u and d (n, 2): mean of both planes and half their difference, less what the probes are stated to be off."""
    both = []
    for channel in ability(rig).axes[axis].positions:
        sensor = rig.sensors.get(channel)
        both.append(data[channel] if sensor is None else (data[channel] - sensor.offset.value) / sensor.gain.value)
    return np.column_stack([(both[0] + both[1]) / 2, (both[0] - both[1]) / 2])
