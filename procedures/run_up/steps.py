"""From the recorded passage of a shaft through its speeds to synchronous vectors over speed, and the captures on the way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis import orders, serial
from bench.analysis.orders import synchronous
from bench.analysis.sampling import Sampling
from bench.analysis.tachometer import Tachometer
from bench.analysis.vectors import parts
from bench.errors import AnalysisError
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.roles import STATUS
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.shared.sampled import of_telemetry
from procedures.shared.signals import clips
from procedures.synchronous import mark
from procedures.synchronous.dwells import Dwell, full_rate, telemetry_channels

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Integers = npt.NDArray[np.int64]
PASSAGE = "passage"
MISSED = "capture-missed"
LEAST_TURNS = 4  # of a block
TOGETHER = 8  # blocks of equal turns
AHEAD = 1.25  # of the speed at which blocks begin: none of them is faster
ENDS = 0.004  # of the way, left out at either end: there the drive begins and ends its ramp
NEAR = 0.012  # of a speed, to either side: the turns that its vectors are of
NEAR_TURNS = 10  # and at least so many


@dataclass(frozen=True)
class Passage:
    """The whole passage of a `machine`. `t` (n,) s; `data` (12, n) positions and coil currents; `volts` (2, n) greatest of each
    bearing; `flags` (n,); `driven` times and speeds of the drive (m,) each; `moving` the samples of the ramp itself."""

    direction: str
    wanted: float
    tacho: Tachometer
    sampling: Sampling
    t: Array
    data: Array
    volts: Array
    flags: Integers
    driven: tuple[Array, Array]
    moving: slice
    stuck: tuple[str, ...]
    clips: int
    lost: int
    expected: int
    machine: AmbRotor

    @property
    def period_s(self) -> float:
        """From one sample to the next."""
        return float(np.median(np.diff(self.t)))

    @property
    def speeds(self) -> Array:
        """By the pulses, at each sample, rad/s (n,); NaN before the first and after the last."""
        return self.tacho.speed(self.t)

    @property
    def name(self) -> str:
        """As it is named to the reader."""
        return {"up": "run-up", "down": "coast-down"}[self.direction]


@dataclass(frozen=True)
class Curve:
    """Vectors of order 1 of b blocks by rising speed: `speed` rad/s, `acceleration` rad/s^2, `width` rad/s (b,); `values`
    (12, b) as read; their scatter `covariance` (12, b, 2, 2) with `dof` (b,); `means` (b, 12); `volts` (b, 2) greatest;
    `second` (12, b) vectors of order 2, NaN where the telemetry does not see it."""

    speed: Array
    acceleration: Array
    width: Array
    values: Complex
    covariance: Array
    means: Array
    volts: Array
    second: Complex
    dof: Array
    machine: AmbRotor


def read_passage(recording: Recording[Any]) -> Passage:
    """The passage that was recorded.

    Raises:
        AnalysisError: there is none, it has no turns, or it did not get anywhere.
    """
    steps = list(recording.steps(PASSAGE))
    if not steps:
        raise AnalysisError("found no passage through the speeds; expected one (was the run stopped early?)")
    step, tick, machine = steps[0], recording.rig.devices["controller"].tick_s, conventions(recording.rig)
    names = (*machine.positions, *machine.currents)
    data = step.read(*telemetry_channels(recording.rig), *machine.plane_voltages)
    t = (data["t_ns"] - recording.start_ns) * 1e-9
    if t.size < 100:
        raise AnalysisError(f"passage: found {t.size} samples; expected 100 or more")
    ticks = round(recording.streams["telemetry"].period_ns * 1e-9 / tick)
    tacho = mark.tachometer_of(recording.rig, t, data)
    wide = np.array([data[c] for c in names])
    driven = driven_channel(recording.rig)
    drive = recording.channel(driven, step.start_ns, step.end_ns)
    labels = step.labels
    return Passage(
        str(labels["direction"]),
        float(labels["acceleration_rad_s2"]),
        tacho,
        of_telemetry(recording.rig, ticks * tick),
        t,
        wide,
        np.array([data[c] for c in machine.plane_voltages]).reshape(-1, t.size),
        data[STATUS].astype(np.int64),
        ((drive["t_ns"] - recording.start_ns) * 1e-9, drive[driven]),
        _moving(tacho.speed(t)),
        tuple(c for c, x in zip(names, wide, strict=True) if np.ptp(x) == 0),
        clips(wide[:4]),
        step.lost(),
        step.expected(),
        machine,
    )


def driven_channel(rig: RigFile) -> str:
    """Of the speed that the drive tells; as its registers are recorded.

    Raises:
        AnalysisError: no device has that role.
    """
    for name, device in rig.devices.items():
        if "drive" in device.roles:
            return f"{name}_actual_speed"
    raise AnalysisError("devices: found none in the role drive")


def _moving(speed: Array) -> slice:
    """From the last sample at the one end of the speeds to the first at the other."""
    low, high = float(np.nanmin(speed)), float(np.nanmax(speed))
    if high < 1.2 * low:
        raise AnalysisError(f"passage: the speed went from {low:.4g} to {high:.4g} rad/s; expected a run through more")
    margin = ENDS * (high - low)
    slow, fast = np.flatnonzero(speed < low + margin), np.flatnonzero(speed > high - margin)
    return slice(int(slow[-1]), int(fast[0])) if slow[0] < fast[0] else slice(int(fast[-1]), int(slow[0]))


def batch_turns(speed: float, period_s: float) -> int:
    """How many turns at `speed` rad/s a batch needs for samples enough: one, where four or more come in a turn."""
    in_turn = 2 * math.pi / (speed * period_s)
    return 1 if in_turn >= orders.IN_SHORT else math.ceil((orders.IN_BATCH + 1) / in_turn)


def _batches(turns: int, speed: float, period_s: float) -> int:
    long = batch_turns(speed, period_s)
    return orders.BATCHES if long == 1 else min(orders.BATCHES, max(LEAST_TURNS, turns // long))


def curve(p: Passage, blocks: int) -> Curve:
    """Vectors of blocks that are equally wide in speed, and at least four turns long, or four batches where few samples come in
    a turn.

    Raises:
        AnalysisError: too few turns.
    """
    read = p.t - p.sampling.late
    angle, speed = np.where(read < p.tacho.times[0], -np.inf, p.tacho.angle(read)), p.speeds
    at, end = p.moving.start, p.moving.stop
    step = abs(float(speed[end - 1] - speed[at])) / blocks
    rate = np.abs(np.gradient(speed[at:end], p.t[at:end]))
    smooth = np.convolve(rate, np.ones(201) / 201, "same") if rate.size > 400 else np.full(rate.size, rate.mean())
    smooth = np.maximum(smooth, 0.1 * rate.mean())
    rows: list[tuple[Any, ...]] = []
    whole = math.ceil(angle[at] / (2 * math.pi))
    while True:
        k = int(np.searchsorted(angle[:end], 2 * math.pi * whole))
        if k >= end:
            break
        least = LEAST_TURNS * batch_turns(AHEAD * speed[k], p.period_s)
        turns = max(least, round(step * speed[k] / (2 * math.pi * smooth[min(max(k - at, 100), smooth.size - 101)])))
        left = math.floor(angle[end - 1] / (2 * math.pi)) - whole
        count = min(TOGETHER, left // turns)
        if count < 1:
            break
        rows.append(_piece(p, angle, whole, whole + count * turns, turns))
        whole += count * turns
    if not rows:
        raise AnalysisError("passage: found no block of four turns")
    joined = [np.concatenate(parts_, axis=0) for parts_ in zip(*rows, strict=True)]
    return _ordered(joined, p.machine)


def _piece(p: Passage, angle: Array, first: int, last: int, turns: int) -> tuple[Any, ...]:
    """Some blocks of equal turns: mean times, speeds, widths, values, moves, means, volts, order 2."""
    low, high = np.searchsorted(angle[: p.moving.stop], 2 * math.pi * np.array([first, last], dtype=float))
    part = slice(max(int(low) - 1, 0), int(high) + 1)  # a sample beyond either end
    fast = float(np.nanmax(p.speeds[part]))
    both = (1.0, 2.0) if 2 * fast / (2 * math.pi) < 0.4 / p.period_s else (1.0,)
    batches = _batches(turns, fast, p.period_s)
    track = synchronous(p.t[part], p.data[:, part], p.tacho, p.sampling, orders=both, turns=turns, batches=batches)
    edges = p.tacho.time(2 * math.pi * (first + turns * np.arange(track.speed.size + 1)))
    places = np.searchsorted(p.t[part], edges)
    volts = np.maximum.reduceat(p.volts[:, part], np.minimum(places[:-1], p.volts[:, part].shape[1] - 1), axis=1).T
    moves = track.moves[..., 0]
    moved = parts(moves[..., None])
    covariance = np.einsum("bmci,bmcj->bcij", moved, moved)
    alone, whole = serial.variances(moves)
    second = track.values[..., 1] if len(both) > 1 else np.full((track.speed.size, 12), np.nan + 0j)
    dof = np.full(track.speed.size, track.dof)
    width = np.abs(np.diff(p.tacho.speed(np.clip(edges, p.tacho.times[0], p.tacho.times[-1]))))
    return track.t, track.speed, width, track.values[:, :, 0], covariance, alone, whole, track.means, volts, second, dof


def _ordered(joined: Sequence[Any], machine: AmbRotor) -> Curve:
    t, speed, width, values, covariance, alone, whole, means, volts, second, dof = joined
    for kind in (slice(0, 4), slice(4, 12)):  # positions, currents
        covariance[:, kind] *= serial.inflation(alone[:, kind], whole[:, kind])[:, None, None, None]
    acceleration = np.gradient(speed, t)
    order = np.argsort(speed, kind="stable")
    rising = order[np.concatenate([[True], np.diff(np.maximum.accumulate(speed[order])) > 0])]
    return Curve(
        speed[rising],
        acceleration[rising],
        width[rising],
        values[rising].T,
        np.swapaxes(covariance[rising], 0, 1),
        means[rising],
        volts[rising],
        second[rising].T,
        dof[rising],
        machine,
    )


def passed(direction: str, law: str) -> str:
    """How a passage is named: by its direction, and the law where one was chosen."""
    return f"{direction}, {law}" if law else direction


def near(p: Passage, recording: Recording[Any], speed: float, law: str) -> tuple[Dwell, float] | None:
    """The turns about a speed as a dwell, with its capture where there is one, and by how much the speed went, rad/s; None
    where the shaft did not come through it."""
    angle, w = p.tacho.angle(p.t), p.speeds
    inside = w[p.moving]
    if not np.nanmin(inside) < speed < np.nanmax(inside):
        return None
    k = p.moving.start + int(np.nanargmin(np.abs(inside - speed)))
    close = np.flatnonzero(np.abs(inside - speed) < NEAR * speed) + p.moving.start
    turn = 2 * math.pi
    least = max(NEAR_TURNS, LEAST_TURNS * batch_turns(AHEAD * speed, p.period_s))
    half = max(float(angle[close[-1]] - angle[close[0]]) / 2, turn * (least / 2 + 0.5))
    low, high = np.searchsorted(angle[: p.moving.stop], [angle[k] - half, angle[k] + half])
    part = slice(max(int(low), p.moving.start), min(int(high), p.moving.stop))
    told = [n for n in (1.0, 2.0, 3.0) if n == 1 or n * speed / turn < 0.4 / p.period_s]
    batches = _batches(int((angle[high - 1] - angle[low]) / turn), AHEAD * speed, p.period_s)
    track = synchronous(p.t[part], p.data[:, part], p.tacho, p.sampling, orders=told, batches=batches)
    captures = recording.captures(passed_rad_s=speed)
    full = full_rate(captures[0], p.machine) if captures else None
    driven = float(np.interp(p.t[k], *p.driven))
    dwell = Dwell(
        PASSAGE, passed(p.direction, law), speed, driven, False, p.tacho, track, full,
        int(np.bitwise_or.reduce(p.flags[part])), 0, (), 0, 1, recording.start_ns + round(p.t[k] * 1e9),
        p.sampling, p.machine,
    )  # fmt: skip
    return dwell, abs(float(w[part.stop - 1] - w[part.start]))
