"""From recorded sines to arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from procedures.position_loops.injection import ability
from procedures.position_loops.lines import without_trend
from procedures.sensor_delay.plan import Plan
from procedures.sensor_delay.sines import probes

Array = npt.NDArray[np.float64]
SINE = "sine"


@dataclass(frozen=True)
class Taken:
    """A sine into a `loop`, of the line number `line`, at `hz`: so many `periods` of all `positions` and `currents`
    (probes, n), empty where it was not captured; `wave`, the captured sine's amplitude as a share (NaN: not captured); share of
    the telemetry in which the loop was `limited`, `states` of the controller, samples `lost` of those `expected`."""

    loop: str
    line: int
    hz: float
    periods: int
    positions: Array
    currents: Array
    wave: float
    limited: float
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it."""
        return f"{self.loop}, {self.hz:.4g} Hz"


def read_taken(recording: Recording[Plan]) -> list[Taken]:
    """Every sine, in time order."""
    return [_taken(recording, step) for step in recording.steps(SINE)]


def _taken(recording: Recording[Plan], step: Step) -> Taken:
    rig, labels = recording.rig, step.labels
    can, some = ability(rig), probes(rig)
    loop = str(labels["loop"])
    bit, names = can.loops[loop].limited, rig.choices(STATE)
    told = step.read(STATE, *([bit.channel] if bit is not None else []))
    limited = 0.0
    if bit is not None and len(told[STATE]):
        flags = told[bit.channel].astype(np.int64)
        limited = float(np.mean(flags != 0 if bit.mask is None else flags & bit.mask != 0))
    states = tuple(names.get(int(code), str(int(code))) for code in np.unique(told[STATE]))
    found, n, periods = recording.captures(number=labels["number"]), int(labels["samples"]), int(labels["periods"])
    positions, currents, wave = np.empty((len(some), 0)), np.empty((len(some), 0)), float("nan")
    if found and found[0].samples >= n:
        data = found[0].arrays(
            *(p.channel for p in some), *(p.current for p in some), *([can.wave] if can.wave else [])
        )
        positions = np.array([data[p.channel][:n] for p in some])
        currents = np.array([data[p.current][:n] for p in some])
        wave = abs(without_trend(data[can.wave][:n], periods)[0]) if can.wave else wave
    return Taken(loop, int(labels["line"]), float(labels["hz"]), periods, positions, currents, wave, limited, states,
                 step.lost(), step.expected())  # fmt: skip
