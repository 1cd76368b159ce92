"""From the recorded dwells of a turning shaft to synchronous vectors, full-rate orbits and what the coils needed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis.orders import Track, synchronous
from bench.analysis.sampling import Sampling
from bench.analysis.tachometer import Tachometer, counted, tachometer
from bench.analysis.vectors import Vectors
from bench.errors import AnalysisError
from bench.procedure.requires import Requires
from bench.recording import Captured, Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.recorded import unrecorded
from bench.rigfile.roles import STATUS
from bench.units import RPM
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.shared.sampled import of_telemetry
from procedures.shared.signals import clips
from procedures.synchronous import facts, mark

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
DWELL, SLOW = "dwell", "slow-roll"
ORDERS = (1.0, 2.0, 3.0)
TELLS = 0.4  # of the telemetry's rate: what is above is not stated


@dataclass(frozen=True)
class Full:
    """A capture: times `t` (n,) s, positions (4, n) m, currents and voltages (8, n) (0, where none are captured), its `rate` Hz
    and pulses; `trigger_s`."""

    t: Array
    positions: Array
    currents: Array
    voltages: Array
    rate: float
    tacho: Tachometer


@dataclass(frozen=True)
class Dwell:
    """The shaft at one speed with one setting of the controller. `wanted` rad/s as planned, `driven` as the drive says, `speed`
    by the pulses; `track` of the four positions and eight coil currents, `sampling` of these; `flags` ORed; `stuck` channels;
    `again`: a repeat at the end. `full` None where nothing was captured. `machine` has the names of all these."""

    kind: str
    variant: str
    wanted: float
    driven: float
    again: bool
    tacho: Tachometer
    track: Track
    full: Full | None
    flags: int
    clips: int
    stuck: tuple[str, ...]
    lost: int
    expected: int
    start_ns: int
    sampling: Sampling
    machine: AmbRotor

    @property
    def speed(self) -> float:
        """Mean speed by the pulses, rad/s."""
        return float(self.track.speed[0])

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        name = f"{self.wanted * RPM:.0f} r/min, {self.variant}"
        return f"slow roll, {name}" if self.kind == SLOW else f"{name}, again" if self.again else name

    @property
    def date(self) -> str:
        """When it began, ISO 8601, UTC."""
        return datetime.fromtimestamp(self.start_ns * 1e-9, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")

    def readings(self, order: float = 1.0) -> Vectors:
        """Synchronous vectors of the four probes, as they read."""
        return self.track.vectors(0, range(4), order)

    def both(self, order: float = 1.0) -> Vectors:
        """Those of the four probes and the eight coils."""
        return self.track.vectors(0, range(12), order)

    @property
    def means(self) -> Array:
        """Of the same twelve channels."""
        return np.asarray(self.track.means[0])


def telemetry_channels(rig: RigFile) -> tuple[str, ...]:
    """What is read of the telemetry of a dwell."""
    machine = conventions(rig)
    return (*machine.positions, *machine.currents, *mark.told(rig), STATUS)


def captured_channels(machine: AmbRotor) -> tuple[str, ...]:
    """What is captured in a dwell."""
    return (*machine.positions, *machine.currents, *machine.voltages, *machine.pulsed)


def telemetry_period_s(rig: RigFile) -> float:
    """From one sample of the telemetry to the next."""
    return rig.messages[rig.binding.telemetry[0]].period_s


def can_capture(rig: RigFile) -> bool:
    """Whether the controller records at its full rate what orbits, spectra and the coils' needs are read of."""
    return rig.capture is not None and not uncapturable(rig)


def uncapturable(rig: RigFile) -> tuple[str, ...]:
    """What a controller that captures would have to record besides; coil voltages are done without."""
    known, machine = rig.capture.channels if rig.capture is not None else {}, conventions(rig)
    needed = (name for name in (*machine.positions, *machine.currents) if name not in known)
    return (*needed, *unrecorded(rig))


def required(rig: RigFile) -> Requires:
    """What every procedure needs that watches the shaft while it turns; captures are used where the controller has them."""
    machine = conventions(rig)
    return Requires(
        lacks=(*machine.lacks, *(() if facts.stated(rig) else facts.missing(rig))),
        roles=("levitation", "drive"),
        channels=(*machine.positions, *machine.currents, *mark.needed(rig), STATUS),
        sensors=(*machine.positions, *machine.currents),
        capabilities=("set_points",),
        uses=("settings.law", "settings.compensation", "capture"),
    )


def read_dwells(recording: Recording[Any]) -> list[Dwell]:
    """Slow roll and dwells in time order.

    Raises:
        AnalysisError: there are no dwells, or one has no turns.
    """
    steps = sorted([*recording.steps(SLOW), *recording.steps(DWELL)], key=lambda s: s.start_ns)
    if not any(s.kind == DWELL for s in steps):
        raise AnalysisError("found no dwells; expected those of the plan (was the run stopped early?)")
    return [read_dwell(recording, step) for step in steps]


def read_dwell(recording: Recording[Any], step: Step) -> Dwell:
    """A slow roll or a dwell.

    Raises:
        AnalysisError: it has no turns.
    """
    tick, machine = recording.rig.devices["controller"].tick_s, conventions(recording.rig)
    names = (*machine.positions, *machine.currents)
    data = step.read(*telemetry_channels(recording.rig))
    t = (data["t_ns"] - recording.start_ns) * 1e-9
    ticks = round(recording.streams["telemetry"].period_ns * 1e-9 / tick)
    sampling = of_telemetry(recording.rig, ticks * tick)
    if len(t) < 100:
        raise AnalysisError(f"{step.kind} {dict(step.labels)}: found {len(t)} samples; expected 100 or more")
    tacho = mark.tachometer_of(recording.rig, t, data)
    wide = np.array([data[c] for c in names])
    track = synchronous(
        t, wide, tacho, sampling, orders=orders_seen(ORDERS, float(step.labels["speed_rad_s"]), ticks * tick)
    )
    labels, flags = step.labels, data[STATUS].astype(np.int64)
    captures = recording.captures(dwell=labels["number"]) if step.kind == DWELL else ()
    full = full_rate(captures[0], machine) if captures else None
    held = max(
        clips(wide[:4]), clips(full.positions) if full else 0
    )  # a turn at speed is a few samples of the telemetry
    return Dwell(
        step.kind, str(labels["variant"]), float(labels["speed_rad_s"]), float(labels["driven_rad_s"]),
        bool(labels["again"]), tacho, track, full, int(np.bitwise_or.reduce(flags)), held,
        tuple(c for c, x in zip(names, wide, strict=True) if np.ptp(x) == 0),
        step.lost(), step.expected(), step.start_ns, sampling, machine,
    )  # fmt: skip


def orders_seen(orders: Sequence[float], speed: float, period: float) -> tuple[float, ...]:
    """Orders that the telemetry's period leaves well below half its rate."""
    return tuple(n for n in orders if n == 1 or n * speed / (2 * math.pi) < TELLS / period)


def full_rate(captured: Captured, machine: AmbRotor) -> Full:
    """A capture as arrays.

    Raises:
        AnalysisError: it has fewer than four pulses, or samples are missing.
    """
    data: Mapping[str, Array] = captured.arrays(*captured_channels(machine))
    t = data["t_s"]
    count, age = (data[name] for name in machine.pulsed)
    tacho = tachometer(*counted(t, count, age))
    kinds = (machine.positions, machine.currents, machine.voltages)
    three = [np.array([data[c] for c in names]) for names in kinds]
    return Full(t, three[0], three[1], three[2], captured.rate_hz, tacho)
