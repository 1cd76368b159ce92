"""Labels of what is recorded, and from a recording to readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.inductance_map.places import Place
from procedures.stages.stators import Phase, phases
from procedures.static_characteristics.places import SIDES, grid
from procedures.static_characteristics.plan import Plan
from procedures.static_characteristics.requires import Cell, cells

Array = npt.NDArray[np.float64]
READING, READ = "reading", "cell-read"


@dataclass(frozen=True)
class Taken:
    """Of m places, l loads of `phases` with levels, 0 for nothing, as `places.loads` has them: `loads` (m, l, 2, 2), places,
    loads, sides, axis along and around, N and N m as cells show them by their signs, gains and arms as stated; `times` s and
    `currents` A (m, l, 2, 6) of all phases; what encoders read without currents, `x` m and `angle` rad (m,), and by how much
    they moved at most under a current, `went` m and rad. NaN where there is none."""

    places: Sequence[Place]
    phases: Sequence[Phase]
    loads: Array
    times: Array
    currents: Array
    x: Array
    angle: Array
    went: tuple[float, float]
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it: everywhere."""
        return ""


def read_taken(recording: Recording[Plan]) -> Taken:
    """Every reading."""
    return taken_at(recording, grid(recording.plan), recording.steps(READING).items)


def taken_at(recording: Recording[Plan], places: Sequence[Place], steps: Sequence[Step]) -> Taken:
    """What was read at these places, in steps that are of them; not all loads need be there."""
    rig, plan = recording.rig, recording.plan
    both, some, rows = cells(rig), phases(rig), {p.number: k for k, p in enumerate(places)}
    assert both is not None
    shown = {(e["number"], e["axis"]): float(e["value"]) for e in recording.events(READ)}
    shape = (len(places), 2 + len(some) * len(plan.levels_A), 2)
    found, times, currents = np.full((*shape, 2), np.nan), np.full(shape, np.nan), np.full((*shape, len(some)), np.nan)
    read, names = np.full((*shape, 2), np.nan), set[str]()
    for step in steps:
        at = rows[int(step.labels["place"])], int(step.labels["load"]), SIDES.index(step.labels["side"])
        data = step.read(*(c.axis.channel for c in both), *(p.current for p in some), STATE)
        if not len(data[STATE]):
            continue
        names |= _states(rig, data[STATE])
        times[at] = 1e-9 * (step.start_ns - recording.start_ns)
        currents[at] = [data[p.current].mean() for p in some]
        for k, cell in enumerate(both):
            read[(*at, k)] = data[cell.axis.channel].mean()
            found[(*at, k)] = _load(cell, step, shown)
    without = np.nanmean(read[:, [0, -1]], axis=(1, 2)) if steps else read[:, 0, 0]
    went = np.nanmax(np.abs(read - without[:, None, None]), axis=(0, 1, 2), initial=0.0)
    lost, expected = (sum(f(s) for s in steps) for f in (Step.lost, Step.expected))
    return Taken(places, some, found, times, currents, without[:, 0], without[:, 1], (float(went[0]), float(went[1])),
                 tuple(sorted(names)), lost, expected)  # fmt: skip


def _load(cell: Cell, step: Step, shown: Mapping[tuple[int, str], float]) -> float:
    by = cell.by
    value = step.mean(by.channel) if by.channel else shown.get((int(step.labels["number"]), cell.axis.name), np.nan)
    return by.sign * value / by.gain.value * cell.length


def _states(rig: RigFile, codes: Array) -> set[str]:
    names = rig.choices(STATE)
    return {names.get(int(code), str(int(code))) for code in np.unique(codes)}
