"""What the mover truly does when it is sent to and fro or follows sines: the same machine, homed and commanded as it was row by
row, and from the end of each mode on sent the same way for longer, by itself. Where the axis that waits rests within its count
goes with the whole history, and a little of what the other one does goes with that: so the history is gone through again."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from bench.rigfile import RigFile
from sim_backend.core.plant import Array
from sim_backend.machine import Truth
from sim_backend.machines.rlsrm.device import SETTABLE, StagePlant
from sim_backend.machines.rlsrm.params import PlantParams
from sim_backend.machines.rlsrm.plant import AXES, TRACE
from sim_backend.motion import SinesFollowed, StepsFollowed

ROW_S: Final = 1e-3
REPEATS: Final = 16
BEAT_ROWS: Final = 20
COMMANDS: Final = ("home", "hold", "play", "stop")
Found = Iterator[tuple[str, str, float]]


def following(rig: RigFile, drawn: Truth, asked: StepsFollowed | SinesFollowed) -> Mapping[tuple[str, str], float]:
    """Every quantity by name and where; nothing where the machine trips."""
    del rig
    built: Any = drawn.plant
    replay = Replay(StagePlant(built), asked.settings, asked.commands)
    of = steps if isinstance(asked, StepsFollowed) else sines
    out = {(name, where): value for name, where, value in of(replay, built.plant, asked)}  # type: ignore[operator]
    return out if replay.plant.core.fault == "NONE" else {}


class Replay:
    """A machine that is commanded again: (row, command or parameter, value), rows from the first command on."""

    def __init__(
        self, plant: StagePlant, settings: Mapping[str, float], commands: Sequence[tuple[int, str, float]]
    ) -> None:
        self.plant, self._commands, self.row = plant, list(commands), 0
        plant.core.power_on()
        for name, value in settings.items():
            if name in SETTABLE and not name.endswith("_target") and name != "pulse_s":
                plant.set(name, value)
        plant.core.command("ready")

    def to(self, row: int) -> None:
        """Go on to a row, with all that was commanded before it."""
        while self._commands and self._commands[0][0] < row:
            at, name, value = self._commands.pop(0)
            self.run(at - self.row)
            if name in COMMANDS:
                self.plant.core.command(name)
            elif name in SETTABLE:
                self.plant.set(name, value)
        self.run(row - self.row)

    def run(self, rows: int) -> Array:
        """Rows of the core, one each millisecond, while a host is heard."""
        self.row += rows
        core, parts = self.plant.core, [np.empty((0, len(TRACE)))]
        for k in range(0, rows, BEAT_ROWS):
            core.beat()
            parts.append(core.run(min(BEAT_ROWS, rows - k) * ROW_S))
        return np.concatenate(parts)

    def fork(self) -> Replay:
        """Another one, which goes its own way from here."""
        other = Replay.__new__(Replay)
        other.plant, other._commands, other.row = StagePlant(self.plant.built), [], self.row
        self.plant.core.copy_to(other.plant.core)
        return other


def by_encoder(p: PlantParams, axis: str, true: Array) -> Array:
    """True places (n,) by the scale of an encoder whose counts are infinitely fine."""
    k = AXES.index(axis)
    seen = true * (1 + p.scale) if axis == "x" else true + p.once * np.sin(true - p.once_phase)
    return np.asarray(seen + p.edge[k] * p.pitch[k])


def _column(rows: Array, name: str) -> Array:
    return rows[:, TRACE.index(name)]


def _true(rows: Array, axis: str) -> Array:
    """True places (n,) from the zero that was found: the mark of the angle is there once a turn."""
    true = _column(rows, f"true_{axis}")
    turn = 2 * math.pi if axis == "angle" else math.inf
    turns = round(float((true - _column(rows, axis)).mean()) / turn)
    return np.asarray(true - turns * turn) if turns else true


def steps(replay: Replay, p: PlantParams, asked: StepsFollowed) -> Found:
    """By name and where, of ever so many steps."""
    for mode in asked.modes:
        replay.to(mode.end_row)
        other, found = replay.fork(), dict[tuple[str, str], list[tuple[float, ...]]]()
        for _ in range(REPEATS):
            for up in (1, 0):
                other.run(asked.before_rows - 1)
                rows = _sent(other, {a: asked.places[a][up] for a in mode.axes}, mode.stagger, asked.dwell_rows)
                for a in mode.axes:
                    one = _stepped(rows[mode.stagger[a] :], p, a, asked, up)
                    found.setdefault((a, mode.wheres[a][up]), []).append(one)
        for (a, where), each in found.items():
            error, true, over, time = np.mean(np.array(each), axis=0)
            end = "" if a == "x" else "_angle"
            yield f"static_error{end}", where, float(error)
            yield f"true_static_error{end}", where, float(true)
            yield "overshoot", where, float(over)
            if math.isfinite(time):
                yield "settling_time", where, float(time)


def _sent(other: Replay, targets: Mapping[str, float], stagger: Mapping[str, int], rows: int) -> Array:
    """Axes sent one after the other; the row before the first one's set point moves is the first."""
    parts, done = [other.run(1)], 0
    for axis in sorted(targets, key=lambda a: stagger[a]):
        parts.append(other.run(stagger[axis] - done))
        other.plant.core.send(AXES.index(axis), targets[axis])
        done = stagger[axis]
    return np.concatenate([*parts, other.run(rows - done)])


def _stepped(rows: Array, p: PlantParams, axis: str, asked: StepsFollowed, up: int) -> tuple[float, ...]:
    low, high = asked.places[axis]
    target, way = (high if up else low), (1.0 if (high > low) == bool(up) else -1.0)
    true = _true(rows, axis)
    size, rest = abs(high - low), asked.rest_rows
    beyond = way * (by_encoder(p, axis, true) - target)
    return (
        float(beyond[-rest:].mean()), float((way * (true - target))[-rest:].mean()), float(beyond.max()) / size,
        _settled(beyond, asked.band * size),
    )  # fmt: skip


def _settled(beyond: Array, band: float) -> float:
    """When it crosses the band for good, s, between two rows on the straight line; the set point starts with the first row."""
    outside = np.flatnonzero(np.abs(beyond) > band)
    if not len(outside) or outside[-1] + 1 == len(beyond):
        return math.nan if len(outside) else 0.0
    k = int(outside[-1])
    a, b = (abs(float(x)) for x in beyond[k : k + 2])
    return (k + (a - band) / (a - b)) * ROW_S


def sines(replay: Replay, p: PlantParams, asked: SinesFollowed) -> Found:
    """By name and where, of ever so many periods."""
    for mode in asked.modes:
        replay.to(mode.end_row)
        rows = replay.fork().run(REPEATS * asked.period_rows)
        for a in mode.axes:
            yield from _followed(rows, p, a, mode.wheres[a][0], asked.period_rows)


def _followed(rows: Array, p: PlantParams, axis: str, where: str, n: int) -> Found:
    reference, true = _column(rows, f"ref_{axis}"), _true(rows, axis)
    place, end = by_encoder(p, axis, true), "" if axis == "x" else "_angle"
    error = place - reference
    yield f"largest_error{end}", where, float(np.abs(error).reshape(-1, n).max(axis=1).mean())
    yield f"true_largest_error{end}", where, float(np.abs(true - reference).reshape(-1, n).max(axis=1).mean())
    yield f"rms_error{end}", where, float(np.sqrt((error**2).reshape(-1, n).mean(axis=1)).mean())
    turn = np.exp(-2j * np.pi * np.arange(len(rows)) / n)
    answer = complex((place * turn).mean() / (reference * turn).mean())
    yield "amplitude_ratio", where, abs(answer)
    yield "lag", where, -math.atan2(answer.imag, answer.real) * n * ROW_S / (2 * math.pi)
