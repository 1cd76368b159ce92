"""From recorded steps to arrays: readings at each place, and what the gate did while a probe was kept beyond it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from procedures.gate_margin.place import TRIAL, WINDOWS, Place, captured, limits
from procedures.position_loops.movers import radial

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Taken:
    """At one place: `readings` (n, p) m of all radial probes and `currents` by channel (n,) A, every `step_s`; empty without a
    capture. `telemetry`, the largest |reading| that it shows; `limited`, the share of its samples in which a bearing's force
    was at its limit; states, samples lost and expected."""

    place: Place
    step_s: float
    readings: Array
    currents: dict[str, Array]
    telemetry: float
    limited: float
    states: tuple[str, ...]
    lost: int
    expected: int


@dataclass(frozen=True)
class Trial:
    """The gate with one probe beyond it: `pulsed` for short times again and again, else throughout. `farthest` and `nearest`,
    the largest and the least |reading| of it; the states that the controller was in."""

    probe: str
    pulsed: bool
    nearest: float
    farthest: float
    states: tuple[str, ...]


def _states(recording: Recording[Any], step: Step) -> tuple[str, ...]:
    names = recording.rig.choices(STATE)
    return tuple(names.get(int(code), str(int(code))) for code in np.unique(step.read(STATE)[STATE]))


def _limited(recording: Recording[Any], step: Step) -> float:
    """0 where the controller does not tell of its limits."""
    hit = np.zeros(1, bool)
    for bit in limits(recording.rig):
        flags = step.read(bit.channel)[bit.channel].astype(np.int64)
        now = flags != 0 if bit.mask is None else flags & bit.mask != 0
        hit = now | hit if len(hit) in (1, len(now)) else now
    return float(hit.mean()) if len(hit) else 0.0


def read_taken(recording: Recording[Any]) -> list[Taken]:
    """Every place, in time order."""
    rig, out = recording.rig, []
    probes = tuple(radial(rig).values())
    for step in recording.steps(WINDOWS):
        told = step.read(*probes)
        far = max((float(np.abs(told[c]).max()) for c in probes if len(told[c])), default=np.nan)
        place = Place(float(step.labels["place_m"]), float(step.labels["angle_rad"]))
        found = recording.captures(number=step.labels["number"])
        readings, currents, step_s = np.empty((0, len(probes))), dict[str, Array](), 0.0
        if found:
            data, step_s = found[0].arrays(*captured(rig)), 1 / found[0].rate_hz
            readings = np.column_stack([data[c] for c in probes])
            currents = {c: data[c] for c in captured(rig) if c not in probes}
        out.append(
            Taken(
                place,
                step_s,
                readings,
                currents,
                far,
                _limited(recording, step),
                _states(recording, step),
                step.lost(),
                step.expected(),
            )
        )
    return out


def read_trials(recording: Recording[Any]) -> list[Trial]:
    """Every one, in time order."""
    rig, out = recording.rig, []
    for step in recording.steps(TRIAL):
        probe = str(step.labels["probe"])
        far = np.abs(step.read(radial(rig)[probe])[radial(rig)[probe]])
        nearest, farthest = (float(far.min()), float(far.max())) if len(far) else (0.0, 0.0)
        out.append(Trial(probe, bool(step.labels["pulsed"]), nearest, farthest, _states(recording, step)))
    return out
