"""What the mover truly does when it is sent to and fro or follows sines: the same machine sent the same way for longer, seen
where it is, and by the encoder's own scale without rounding."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from sim_backend.core.plant import Array
from sim_backend.machines.rlsrm.params import PlantParams
from sim_backend.machines.rlsrm.plant import AXES, TRACE, Plant
from sim_backend.motion import FollowedSteps, SinesAsked

ROW_S: Final = 1e-3
REPEATS: Final = 16
PERIODS: Final = 16
BEAT_S: Final = 0.02
Found = Iterator[tuple[str, str, float]]


def by_encoder(p: PlantParams, axis: str, true: Array) -> Array:
    """True places (n,) by the scale of an encoder whose counts are infinitely fine."""
    k = AXES.index(axis)
    seen = true * (1 + p.scale) if axis == "x" else true + p.once * np.sin(true - p.once_phase)
    return np.asarray(seen + p.edge[k] * p.pitch[k])


def _run(plant: Plant, seconds: float) -> Array:
    """Rows, one each millisecond, while a host is heard."""
    rows, left = [], round(seconds / ROW_S)
    while left > 0:
        plant.beat()
        rows.append(plant.run(min(left, round(BEAT_S / ROW_S)) * ROW_S))
        left -= round(BEAT_S / ROW_S)
    return np.concatenate(rows)


def _column(rows: Array, name: str) -> Array:
    return rows[:, TRACE.index(name)]


def _arrive(plant: Plant, targets: Mapping[str, float], longest_s: float) -> None:
    """Send axes somewhere, until their set points rest there."""
    plant.refer(**targets)
    for _ in range(round(longest_s / 0.05)):
        last = _run(plant, 0.05)[-1]
        if all(abs(last[TRACE.index(f"ref_{a}")] - x) < 1e-9 for a, x in targets.items()):
            return


def steps(plant: Plant, p: PlantParams, asked: FollowedSteps) -> Found:
    """By name and where, of ever so many steps."""
    for axes, wheres in asked.modes:
        _arrive(plant, asked.rest, 30.0)
        _arrive(plant, {a: asked.places[a][0] for a in axes}, 30.0)
        _run(plant, asked.dwell_s)
        found: dict[tuple[str, str], list[tuple[float, ...]]] = {}
        for repeat in range(-asked.lead, REPEATS):
            for up in (1, 0):
                plant.refer(**{a: asked.places[a][up] for a in axes})
                rows = _run(plant, asked.dwell_s)
                for a in axes if repeat >= 0 else ():
                    found.setdefault((a, wheres[a][up]), []).append(_stepped(rows, p, a, asked, up))
        for (a, where), each in found.items():
            error, true, over, time = np.mean(np.array(each), axis=0)
            end = "" if a == "x" else "_angle"
            yield f"static_error{end}", where, float(error)
            yield f"true_static_error{end}", where, float(true)
            yield "overshoot", where, float(over)
            if math.isfinite(time):
                yield "settling_time", where, float(time)


def _stepped(rows: Array, p: PlantParams, axis: str, asked: FollowedSteps, up: int) -> tuple[float, ...]:
    low, high = asked.places[axis]
    target, way = (high if up else low), (1.0 if (high > low) == bool(up) else -1.0)
    true = _column(rows, f"true_{axis}")
    size, rest = abs(high - low), round(asked.rest_s / ROW_S)
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
    return (k + 1 + (a - band) / (a - b)) * ROW_S


def sines(plant: Plant, p: PlantParams, asked: SinesAsked) -> Found:
    """By name and where, of ever so many periods."""
    for axes, wheres in asked.modes:
        _arrive(plant, asked.rest, 30.0)
        speed = {a: plant.of(a, "speed") for a in AXES}
        for a in AXES:
            plant.set("wave", 1.0 if a in axes else 0.0, a)
            plant.set("amplitude", asked.amplitudes.get(a, 0.0), a)
            plant.set("period", asked.period_s, a)
            plant.set("phase", asked.turns if len(axes) > 1 and a == axes[0] else 0.0, a)
        plant.command("play")
        _run(plant, asked.shaped_s)
        for a in AXES:
            plant.set("speed", 0.0, a)
        _run(plant, asked.lead * asked.period_s - asked.shaped_s)
        rows = _run(plant, PERIODS * asked.period_s)
        for a in AXES:
            plant.set("speed", speed[a], a)
        plant.command("stop")
        _run(plant, 0.1)
        for a in AXES:
            plant.set("wave", 0.0, a)
        for a in axes:
            yield from _followed(rows, p, a, wheres[a], asked.period_s)


def _followed(rows: Array, p: PlantParams, axis: str, where: str, period_s: float) -> Found:
    reference, true = _column(rows, f"ref_{axis}"), _column(rows, f"true_{axis}")
    place, n, end = by_encoder(p, axis, true), round(period_s / ROW_S), "" if axis == "x" else "_angle"
    error = place - reference
    yield f"largest_error{end}", where, float(np.abs(error).reshape(-1, n).max(axis=1).mean())
    yield f"true_largest_error{end}", where, float(np.abs(true - reference).reshape(-1, n).max(axis=1).mean())
    yield f"rms_error{end}", where, float(np.sqrt((error**2).reshape(-1, n).mean(axis=1)).mean())
    turn = np.exp(-2j * np.pi * np.arange(len(rows)) / n)
    answer = complex((place * turn).mean() / (reference * turn).mean())
    yield "amplitude_ratio", where, abs(answer)
    yield "lag", where, -math.atan2(answer.imag, answer.real) * period_s / (2 * math.pi)
