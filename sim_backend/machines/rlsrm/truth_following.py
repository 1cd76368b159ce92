"""What the mover truly does when it is sent to and fro or follows sines: the same machine, homed and commanded as it was, tick
by tick. Where an axis that waits rests within its count goes with the whole history, and a little of what the other one does
goes with that: so the history is gone through again."""

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
from sim_backend.machines.rlsrm.plant import AXES, LOOP_TICKS, TICKS_S, TRACE
from sim_backend.stage_motion import SinesFollowed, StageWindow, StepsFollowed

ROW_S: Final = 1e-3
BEAT_TICKS: Final = 20 * LOOP_TICKS
COMMANDS: Final = ("home", "hold", "play", "stop")
KEPT: Final = tuple(f"{name}{axis}" for axis in AXES for name in ("", "true_", "ref_"))
COLUMNS: Final = [TRACE.index(name) for name in KEPT]
Found = Iterator[tuple[str, str, float]]


def following(rig: RigFile, drawn: Truth, asked: StepsFollowed | SinesFollowed) -> Mapping[tuple[str, str], float]:
    """Every quantity by name and where; nothing where the machine trips."""
    del rig
    built: Any = drawn.plant
    plant = StagePlant(built)
    rows = replayed(plant, asked.settings, asked.commands, max(w.end for w in asked.windows))
    found: dict[tuple[str, str], list[float]] = {}
    for w in asked.windows:
        cut, p = rows[w.begin : w.end], built.plant
        told = _step(cut, p, w, asked) if isinstance(asked, StepsFollowed) else _sine(cut, p, w, asked)
        for name, value in told:
            found.setdefault((name, w.where), []).append(value)
    if plant.core.fault != "NONE":
        return {}
    return {key: float(np.mean(values)) for key, values in found.items() if np.isfinite(values).all()}


def replayed(
    plant: StagePlant, settings: Mapping[str, float], commands: Sequence[tuple[int, str, float]], end: int
) -> Array:
    """So many rows of the core (n, len(KEPT)), one each millisecond; (tick, command or parameter, value) in order."""
    core = plant.core
    core.power_on()
    for name, value in settings.items():
        if name in SETTABLE and not name.endswith("_target") and name != "pulse_s":
            plant.set(name, value)
    core.command("ready")
    parts, now, last = [], 0, end * LOOP_TICKS
    for tick, name, value in commands:
        if tick >= last:
            break
        parts.append(_run(plant, tick - now))
        now = tick
        if name in COMMANDS:
            core.command(name)
        elif name in SETTABLE:
            plant.set(name, value)
    return np.concatenate([*parts, _run(plant, last - now)])


def _run(plant: StagePlant, ticks: int) -> Array:
    """While a host is heard."""
    parts = [np.empty((0, len(KEPT)))]
    for k in range(0, ticks, BEAT_TICKS):
        plant.core.beat()
        parts.append(plant.core.run(min(BEAT_TICKS, ticks - k) / TICKS_S)[:, COLUMNS])
    return np.concatenate(parts)


def by_encoder(p: PlantParams, axis: str, true: Array) -> Array:
    """True places (n,) by the scale of which readings are the nearest counts; of an encoder that gives the next lower count,
    that is half a count lower."""
    k = AXES.index(axis)
    seen = true * (1 + p.scale) if axis == "x" else true + p.once * np.sin(true - p.once_phase)
    return np.asarray(seen + (p.edge[k] - 0.5 * (p.truncate[k] != 0)) * p.pitch[k])


def _looked(rows: Array, axis: str) -> tuple[Array, Array]:
    """Set points and true places (n,) from the zero that was found: the mark of the angle is there once a turn."""
    read, true, reference = (rows[:, KEPT.index(f"{name}{axis}")] for name in ("", "true_", "ref_"))
    turn = 2 * math.pi if axis == "angle" else math.inf
    turns = round(float((true - read).mean()) / turn)
    return reference, np.asarray(true - turns * turn) if turns else true


def _step(rows: Array, p: PlantParams, w: StageWindow, asked: StepsFollowed) -> Iterator[tuple[str, float]]:
    start, target = w.places
    way, size, end = (1.0 if target > start else -1.0), abs(target - start), "" if w.axis == "x" else "_angle"
    _, true = _looked(rows, w.axis)
    beyond = way * (by_encoder(p, w.axis, true) - target)
    yield f"static_error{end}", float(beyond[-asked.rest_rows :].mean())
    yield f"true_static_error{end}", float((way * (true - target))[-asked.rest_rows :].mean())
    yield "overshoot", float(beyond.max()) / size
    yield "settling_time", settled(beyond, asked.band * size)


def settled(beyond: Array, band: float) -> float:
    """When it crosses the band for good, s, between two rows on the straight line; the set point starts with the first row."""
    outside = np.flatnonzero(np.abs(beyond) > band)
    if not len(outside) or outside[-1] + 1 == len(beyond):
        return math.nan if len(outside) else 0.0
    k = int(outside[-1])
    a, b = (abs(float(x)) for x in beyond[k : k + 2])
    return (k + (a - band) / (a - b)) * ROW_S


def _sine(rows: Array, p: PlantParams, w: StageWindow, asked: SinesFollowed) -> Iterator[tuple[str, float]]:
    n, end = asked.period_rows, "" if w.axis == "x" else "_angle"
    reference, true = _looked(rows, w.axis)
    place = by_encoder(p, w.axis, true)
    error = place - reference
    yield f"largest_error{end}", float(np.abs(error).reshape(-1, n).max(axis=1).mean())
    yield f"true_largest_error{end}", float(np.abs(true - reference).reshape(-1, n).max(axis=1).mean())
    yield f"rms_error{end}", float(np.sqrt((error**2).reshape(-1, n).mean(axis=1)).mean())
    turn = np.exp(-2j * np.pi * np.arange(len(rows)) / n)
    answer = complex((place * turn).mean() / (reference * turn).mean())
    yield "amplitude_ratio", abs(answer)
    yield "lag", -math.atan2(answer.imag, answer.real) * n * ROW_S / (2 * math.pi)
