"""Visits, from the recording to arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from procedures.bearing_constant.plan import Plan
from procedures.bearing_constant.stand import captured, planes
from procedures.position_loops.injection import ability
from procedures.shared.weight import weight

Array = npt.NDArray[np.float64]
VISIT = "visit"


@dataclass(frozen=True)
class Visit:
    """One lift with what hung: `load` on `hook` ("": nothing), which weighs `newtons`; means of `currents` (planes, 2) A, d and
    q, and of radial `positions` (n,) m; None where it was not captured. `limited`: share of samples in which a loop was
    at its limit."""

    number: int
    hook: str
    load: str
    newtons: float
    currents: Array | None
    positions: Array
    limited: float
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it."""
        return f"visit {self.number}, {f'{self.load} on {self.hook}' if self.load else 'nothing hung'}"


def read_visits(recording: Recording[Plan]) -> list[Visit]:
    """All of them, in time order."""
    return [_read(recording, step) for step in recording.steps(VISIT)]


def newtons(recording: Recording[Plan], load: str) -> float:
    """What a mass weighs, by its certificate."""
    rig = recording.rig
    if not load:
        return 0.0
    site = rig.site
    return float(weight(rig.masses[load].value, site.gravity.value, site.air_density.value, rig.mass_density.value))


def _read(recording: Recording[Plan], step: Step) -> Visit:
    rig, labels = recording.rig, step.labels
    bits = [loop.limited for loop in ability(rig).loops.values() if loop.limited is not None]
    told = step.read(STATE, *{bit.channel for bit in bits})
    hit = np.zeros(len(told[STATE]), dtype=bool)
    for bit in bits:
        flags = told[bit.channel].astype(np.int64)
        hit |= flags != 0 if bit.mask is None else (flags & bit.mask) != 0
    names = rig.choices(STATE)
    states = tuple(names.get(int(code), str(int(code))) for code in np.unique(told[STATE]))
    found = recording.captures(number=labels["number"])
    currents, positions = None, np.empty(0)
    if found and found[0].samples >= 2:
        columns = found[0].arrays(*captured(rig))
        means = np.array([columns[name].mean() for name in captured(rig)])
        count = 2 * len(planes(rig))
        currents, positions = means[:count].reshape(-1, 2), means[count:]
    load = str(labels["load"])
    return Visit(
        int(labels["number"]), str(labels["hook"]), load, newtons(recording, load), currents, positions,
        float(hit.mean()) if hit.size else 0.0, states, step.lost(), step.expected(),
    )  # fmt: skip


def design(visits: Sequence[Visit], hooks: Sequence[str]) -> Array:
    """Columns (n, hooks + 2): N on each hook, nothing, the time."""
    on = [[v.newtons if v.load and v.hook == hook else 0.0 for hook in hooks] for v in visits]
    time = np.linspace(-1, 1, len(visits))
    return np.column_stack([np.array(on), np.ones(len(visits)), time])
