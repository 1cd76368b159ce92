"""From recorded steps to arrays: readings at each place, and what the gate did while a probe was kept beyond it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from procedures.gate_margin.place import TRIAL, WINDOWS, Place, captured, radial

Array = npt.NDArray[np.float64]
STATE = "state"


@dataclass(frozen=True)
class Taken:
    """At one place: `readings` (n, p) m of all radial probes and `currents` by channel (n,) A, every `step_s`; empty without a
    capture. `telemetry`, the largest |reading| that it shows; states, samples lost and expected."""

    place: Place
    step_s: float
    readings: Array
    currents: dict[str, Array]
    telemetry: float
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
            Taken(place, step_s, readings, currents, far, _states(recording, step), step.lost(), step.expected())
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
