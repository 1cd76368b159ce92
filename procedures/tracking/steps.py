"""From the recorded orbits of a tracking test to arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.roles import SPEED, STATUS
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.geometry import Facts, left
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.onset import onset, pushing
from procedures.shared.sampled import of_telemetry
from procedures.tracking.ellipse import Path, Wave
from procedures.tracking.points import delay, read_points
from procedures.tracking.requires import channels, upper_and_lower

Array = npt.NDArray[np.float64]
START, GROWN, ORBIT = "start", "grown", "orbit"
STARTED = "reference-started"
GROWING = 0.25  # of a revolution, that set points begin with


@dataclass(frozen=True)
class Orbit:
    """One law's orbit of a `machine`: its path, the `whole` one from where the reference had grown, coil currents (4, n) A of
    both sides, flags (n,), speed (n,) rad/s, the reference's zero of phase in s on the path's time, and the start's jump of
    current over its noise."""

    law: str
    path: Path
    whole: Path
    upper: Array
    lower: Array
    flags: npt.NDArray[np.int64]
    speed: Array
    t_0: float
    clear: float
    step: Step
    machine: AmbRotor

    def ring_distance(self, facts: Facts) -> float:
        """The least distance to a ring that the readings show, as they stand: m, below zero inside it."""
        return float(left(self.path.readings, facts).min())

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        law = self.law or "as set"
        w, rpm = self.path.wave, float(np.median(self.speed)) * 30 / np.pi
        turning = f"{rpm:.0f} r/min" if self.path.turn_s else "at rest"
        figure = f"{w.hz:g} Hz" if w.ratio == 1 else f"{w.hz:g} Hz, {w.ratio} : 1"
        return f"{law}, {figure}, {w.y * 1e6:g} × {w.z * 1e6:g} µm, {turning}"


def sample_reference(rig: RigFile, hz: float, y: float, z: float, period_ns: int, ratio: int = 1) -> Wave:
    """The reference, as this rig's telemetry samples it."""
    tick = rig.devices["controller"].tick_s
    ticks = of_telemetry(rig, period_ns * 1e-9).ticks
    return Wave(hz, y, z, tick, ticks, ratio, spaced=round(period_ns * 1e-9 / tick))


def read_orbits(recording: Recording[Any]) -> list[Orbit]:
    """Every orbit, in time order.

    Raises:
        AnalysisError: there are none, or the reference has no start.
    """
    starts, orbits = list(recording.steps(START)), list(recording.steps(ORBIT))
    if orbits and not starts:
        return [_read_points(recording, step) for step in orbits]
    if not orbits:
        raise AnalysisError("found no orbits; expected those of the plan (was the run stopped early?)")
    origin = starts[0].start_ns
    t_0, clear = _start(recording, starts[0], _wave(recording, orbits[0]))
    grown = {str(step.labels["law"]): step for step in recording.steps(GROWN)}  # none in recordings of old
    return [_read(recording, step, grown.get(str(step.labels["law"])), origin, t_0, clear) for step in orbits]


def _read_points(recording: Recording[Any], step: Step) -> Orbit:
    """An orbit of set points, whose zero of phase is how late they act."""
    points = read_points(step, step.start_ns)
    if points is None:
        raise AnalysisError("found no start of the reference, and no set points of it; expected one or the other")
    orbit = _read(recording, step, None, step.start_ns, 0.0, 0.0)
    wave = orbit.path.wave
    t_0, clear = delay(
        points, orbit.path.t, orbit.upper, orbit.lower, orbit.machine, wave.tick, wave.ticks, wave.period
    )
    whole = orbit.path.t > points.t[0] + GROWING / orbit.path.wave.hz
    path = replace(orbit.path, t=orbit.path.t[whole], readings=orbit.path.readings[:, whole], points=points)
    return replace(orbit, path=path, whole=path, upper=orbit.upper[:, whole], lower=orbit.lower[:, whole],
                   flags=orbit.flags[whole], speed=orbit.speed[whole], t_0=t_0, clear=clear)  # fmt: skip


def _wave(recording: Recording[Any], step: Step) -> Wave:
    labels, period_ns = step.labels, recording.streams["telemetry"].period_ns
    return sample_reference(recording.rig, float(labels["hz"]), float(labels["y_m"]), float(labels["z_m"]), period_ns,
                   int(labels["ratio"]))  # fmt: skip


def _start(recording: Recording[Any], start: Step, wave: Wave) -> tuple[float, float]:
    """When the reference's phase was zero, s from the step's start, and how clear the currents tell it."""
    machine = conventions(recording.rig)
    begun, path = start.read(*channels(machine)), machine.can.path
    inside = [e for e in recording.events() if start.start_ns <= e["t_ns"] < start.end_ns]
    written = [e["t_ns"] for e in inside if e["kind"] == "parameter" and path is not None and e["name"] == path.on]
    answered = [e["t_ns"] for e in inside if e["kind"] == STARTED]
    if not written or not answered or len(begun["t_ns"]) < 20:
        raise AnalysisError("found no start of the reference; expected its write within the step, and samples about it")
    current = np.sum([pushing(machine, "z", a, begun) for a in machine.along("z")], axis=0)
    lag = conventions(recording.rig).lag_s
    earliest, latest = ((t - start.start_ns) * 1e-9 for t in (written[0], answered[0]))
    at = (begun["t_ns"] - start.start_ns) * 1e-9
    return onset(at, current, earliest, latest, tick=wave.tick, ticks=wave.ticks, lag_s=lag, period_s=wave.period)


def _read(recording: Recording[Any], step: Step, grown: Step | None, origin: int, t_0: float, clear: float) -> Orbit:
    machine = conventions(recording.rig)
    labels, data = step.labels, step.read(*channels(machine))
    if len(data["t_ns"]) < 20:
        raise AnalysisError(f"{labels['law']}: found {len(data['t_ns'])} samples; expected a whole orbit")
    speed = data[SPEED] if machine.speed_told else np.zeros(len(data["t_ns"]))
    turning = float(labels["speed_rad_s"]) > 0 and float(np.median(speed)) > 0
    path = Path(
        _wave(recording, step),
        (data["t_ns"] - origin) * 1e-9,
        np.array([data[c] for c in machine.stations.channels]),
        2 * np.pi / float(np.median(speed)) if turning else 0.0,
    )
    whole = path if grown is None else _join(grown, path, machine.stations.channels, origin)
    upper, lower = (np.array([data[c] for c in names]) for names in upper_and_lower(machine))
    flags = data[STATUS].astype(np.int64)
    return Orbit(str(labels["law"]), path, whole, upper, lower, flags, speed, t_0, clear, step, machine)


def _join(grown: Step, path: Path, names: Sequence[str], origin: int) -> Path:
    """A path with what was recorded before it."""
    data = grown.read(*names)
    t = np.concatenate([(data["t_ns"] - origin) * 1e-9, path.t])
    return replace(path, t=t, readings=np.concatenate([np.array([data[c] for c in names]), path.readings], axis=1))
