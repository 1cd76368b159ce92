"""Runs of a balancing: the shaft at its speeds with known weights on it. Read from captures under way, from telemetry after."""

from __future__ import annotations

import cmath
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis.orders import Track, synchronous
from bench.analysis.sampling import Sampling
from bench.analysis.tachometer import Tachometer, counted, tachometer
from bench.analysis.vectors import Vectors
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.capture import CaptureData
from bench.rigfile.roles import answered, resolved
from bench.samples import TICKS
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.balance.planes import chosen, names_of
from procedures.shared.sampled import of_telemetry
from procedures.synchronous import mark
from procedures.synchronous.bearings import Known
from procedures.synchronous.dwells import ORDERS, SLOW, Dwell, orders_seen, read_dwells, telemetry_period_s
from procedures.synchronous.identified import Reading, find_bearings
from procedures.synchronous.nonsynchronous import folds
from procedures.synchronous.runout import Turning

Array = npt.NDArray[np.float64]
MOUNT, UNMOUNT, DECISION, REFUSED, LIGHTER = "mount", "unmount", "decision", "trial-refused", "trial-lighter"
TAKEN_OFF = "trial-taken-off"
BASE = "base"


@dataclass(frozen=True)
class Weight:
    """A weight in plane 0 (the near one) or 1: `kg` at `angle` rad of the plane's scale; the `number`-th that was fixed."""

    plane: int
    kg: float
    angle: float
    number: int

    def unbalance(self, radius: float) -> complex:
        """kg m, complex, on the plane's scale, at a radius in m."""
        return cmath.rect(self.kg * radius, self.angle)


@dataclass(frozen=True)
class Read:
    """One dwell: mean `speed` rad/s, `means` (12,) and `vectors` (12,) of four probes and eight coils; its pulses `sound`;
    `folds` (4,) m, by how much a higher order that shows as order 1 may move the probes' vectors; `higher` by order, the
    vectors (12,) of higher orders."""

    speed: float
    means: Array
    vectors: Vectors
    sound: bool = True
    folds: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    higher: Mapping[float, npt.NDArray[np.complex128]] = field(default_factory=dict)

    @property
    def turning(self) -> Turning:
        """For the balance of forces."""
        return Turning(self.speed, self.means, self.vectors.values, self.higher)

    @property
    def farthest(self) -> float:
        """How far a probe reads from zero at most, mean and order 1, m."""
        return float((np.abs(self.means[:4]) + np.abs(self.vectors.values[:4])).max())


@dataclass(frozen=True)
class Run:
    """With `weights` mounted, dwells `reads` by speed, the slowest first; `again` the slowest speed once more at the end."""

    name: str
    weights: tuple[Weight, ...]
    reads: tuple[Read, ...]
    again: Read | None = None

    @property
    def fastest(self) -> Read:
        """The dwell at the highest speed."""
        return self.reads[-1]


def captured_channels(machine: AmbRotor) -> tuple[str, ...]:
    """What is captured in a dwell of a balancing: no voltages."""
    return (*machine.positions, *machine.currents, *machine.pulsed)


def read_capture(data: CaptureData, machine: AmbRotor, slow: bool = False) -> Read:
    """Vectors of a capture that was just uploaded. At slow roll the higher orders are the runout's: they are left out.

    Raises:
        AnalysisError: too few pulses or turns.
    """
    c: Mapping[str, Array] = data.columns
    count, age = (c[name] for name in machine.pulsed)
    t = np.arange(len(count)) / data.rate_hz
    tacho: Tachometer = tachometer(*counted(t, count, age))
    wide = np.array([c[n] for n in (*machine.positions, *machine.currents)])
    track = synchronous(t, wide, tacho, Sampling(1 / data.rate_hz))
    return Read(float(track.speed[0]), np.asarray(track.means[0]), track.vectors(0, range(12)), tacho.sound,
                higher={} if slow else _higher(track))  # fmt: skip


def read_telemetry(rig: RigFile, seen: Mapping[str, Array], slow: bool = False) -> Read:
    """Vectors of the telemetry that has just come, by channel and ticks, where the controller captures nothing.

    Raises:
        AnalysisError: too few pulses or turns.
    """
    machine, tick = conventions(rig), rig.devices["controller"].tick_s
    t = seen[TICKS] * tick
    ticks = round(telemetry_period_s(rig) / tick)
    tacho = mark.tachometer_of(rig, t, answered(rig, mark.told(rig), seen))
    wide = np.array([seen[n] for n in (*machine.positions, *machine.currents)])
    orders = orders_seen((ORDERS[:1] if slow else ORDERS), float(np.nanmean(tacho.speed(t))), ticks * tick)
    track = synchronous(t, wide, tacho, of_telemetry(rig, ticks * tick), orders=orders)
    return Read(float(track.speed[0]), np.asarray(track.means[0]), track.vectors(0, range(12)), tacho.sound,
                higher={} if slow else _higher(track))  # fmt: skip


def watched_channels(rig: RigFile) -> tuple[str, ...]:
    """What is looked at of the telemetry for that."""
    machine = conventions(rig)
    return (*machine.positions, *machine.currents, *resolved(rig, mark.told(rig)), TICKS)


def read_dwell(d: Dwell) -> Read:
    """Vectors of a dwell's telemetry."""
    higher = {} if d.kind == SLOW else _higher(d.track)
    return Read(d.speed, d.means, d.both(), d.tacho.sound, tuple(folds(d)[1].tolist()), higher)


def _higher(track: Track) -> dict[float, npt.NDArray[np.complex128]]:
    return {n: track.vectors(0, range(12), n).values for n in track.orders if n > 1}


@dataclass(frozen=True)
class Recorded:
    """All of a recording: `dwells` in time order, the slow roll, the complete runs by name, every weight that was `fixed` with
    its purpose, and those that are still `on` at the end."""

    dwells: tuple[Dwell, ...]
    slow: Read | None
    runs: tuple[Run, ...]
    fixed: tuple[tuple[Weight, str], ...]
    on: tuple[Weight, ...]

    @property
    def machine(self) -> AmbRotor:
        """Whose dwells they are."""
        return self.dwells[0].machine

    def of(self, name: str) -> list[Dwell]:
        """Dwells of a run."""
        return [d for d in self.dwells if d.variant == name and d.kind != SLOW]


def read_runs(recording: Recording[Any], speeds: Sequence[float]) -> Recorded:
    """A recording's runs and what was mounted in each; a run that lacks a speed is left out.

    Raises:
        AnalysisError: there are no dwells, or one has no turns.
    """
    dwells = read_dwells(recording)
    slow = next((read_dwell(d) for d in dwells if d.kind == SLOW), None)
    turning = [d for d in dwells if d.kind != SLOW]
    sides = names_of(chosen(recording.rig, recording.plan.planes))
    mounted: list[tuple[int, Weight | int]] = []
    fixed: list[tuple[Weight, str]] = []
    for step in recording.all_steps():
        labels = step.labels
        if step.kind == MOUNT:
            w = Weight(
                sides.index(str(labels["plane"])), float(labels["kg"]), float(labels["angle_rad"]), len(fixed) + 1
            )
            fixed.append((w, str(labels["purpose"])))
            mounted.append((step.start_ns, w))
        elif step.kind == UNMOUNT:
            mounted.append((step.start_ns, sides.index(str(labels["plane"]))))
    runs = []
    for name in dict.fromkeys(d.variant for d in turning):
        some = [d for d in turning if d.variant == name]
        first = sorted((d for d in some if not d.again), key=lambda d: d.wanted)
        again = next((read_dwell(d) for d in some if d.again), None)
        if len(first) == len(speeds):
            on = _on(mounted, some[0].start_ns)
            runs.append(Run(name, on, tuple(read_dwell(d) for d in first), again))
    return Recorded(tuple(dwells), slow, tuple(runs), tuple(fixed), _on(mounted, 1 << 62))


def known_by(slow: Read | None, runs: Sequence[Run], rig: RigFile, known: Known) -> Known:
    """What is known of the bearings, where the runs must tell it themselves: each has an unbalance of its own."""
    rolled = [] if slow is None else [("slow", slow, 0)]
    reads = [*rolled, *((f"{r.name}/{k}", read, n) for n, r in enumerate(runs) for k, read in enumerate(r.reads))]
    some = [Reading(name, r.speed, r.means, r.vectors, run) for name, r, run in reads]
    return find_bearings(some, rig, known) if some else known


def _on(mounted: Sequence[tuple[int, Weight | int]], at_ns: int) -> tuple[Weight, ...]:
    """What was on the shaft at a time."""
    on: list[Weight] = []
    for t, what in mounted:
        if t < at_ns:
            on = [*on, what] if isinstance(what, Weight) else [w for w in on if w.plane != what]
    return tuple(on)
