"""From recorded sweeps to arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from procedures.cogging_map.plan import Plan
from procedures.cogging_map.sweeps import Way, way
from procedures.position_loops.injection import ability
from procedures.position_loops.lines import unwound
from procedures.position_loops.motors import around, motors

Array = npt.NDArray[np.float64]
SWEEP = "sweep"


@dataclass(frozen=True)
class Pass:
    """One sweep of a `map`, `sign` 1 up or -1 down, with the controller's feedforward or not (`fed`): times s, positions and
    currents by motor (n,) while the position was on the map; share of the samples in which the loop was `limited`, `states` of
    the controller, samples `lost` of those `expected`; over how long one of them is a mean, `mean_s` (0: it is a reading)."""

    map: Way
    sign: int
    fed: bool
    repeat: int
    times: Array
    position: Array
    currents: Mapping[str, Array]
    limited: float
    states: tuple[str, ...]
    lost: int
    expected: int
    mean_s: float = 0.0

    @property
    def where(self) -> str:
        """As findings name it."""
        told = "with" if self.fed else "without"
        return f"{self.map.loop}, {'up' if self.sign > 0 else 'down'}, {told} feedforward, {self.repeat + 1}"


def read_passes(recording: Recording[Plan]) -> list[Pass]:
    """Every sweep, in time order."""
    return [_pass(recording, step) for step in recording.steps(SWEEP)]


def _pass(recording: Recording[Plan], step: Step) -> Pass:
    rig, loop = recording.rig, str(step.labels["loop"])
    one, limited = ability(rig).loops[loop], ability(rig).loops[loop].limited
    of, names, driving = way(rig, recording.plan, loop), rig.choices(STATE), motors(rig, loop)
    flag = [limited.channel] if limited is not None else []
    data = step.read(one.channel, STATE, *(m.current for m in driving.values()), *flag)
    x = np.asarray(data[one.channel], np.float64)
    if around(rig, loop) and x.size:
        x = unwound(x, of.low + of.length / 2)
    on = (x >= of.low) & (x < of.low + of.length)
    hit = np.zeros(x.size, bool)
    if limited is not None:
        flags = data[limited.channel].astype(np.int64)
        hit = flags != 0 if limited.mask is None else flags & limited.mask != 0
    return Pass(
        map=of,
        sign=int(step.labels["way"]),
        fed=bool(step.labels["fed"]),
        repeat=int(step.labels["repeat"]),
        times=(data["t_ns"][on] - step.start_ns) * 1e-9,
        position=x[on],
        currents={name: np.asarray(data[m.current][on], np.float64) for name, m in driving.items()},
        limited=float(hit.mean()) if hit.size else 0.0,
        states=tuple(names.get(int(code), str(int(code))) for code in np.unique(data[STATE])),
        lost=step.lost(),
        expected=step.expected(),
        mean_s=0.0 if rig.binding.samples == "reading" else recording.streams["telemetry"].period_ns * 1e-9,
    )
