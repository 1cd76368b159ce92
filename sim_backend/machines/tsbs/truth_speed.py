"""How fast the servomotor truly turns at its torque limit: the same machine under the same settings for a long time, with other
noise. The noise is part of it: what the law makes of it takes torque, so that a machine without it is another."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend import core
from sim_backend.controller.parameters import Parameters
from sim_backend.core.plant import TICK_S
from sim_backend.machine import Truth
from sim_backend.machines.tsbs.params import PlantParams
from sim_backend.machines.tsbs.plant import TRACE, Plant
from sim_backend.motion import Numbers, SpeedsAsked

Array = npt.NDArray[np.float64]
OTHER_NOISE = 0x5EED
SETTLE_S, CHUNK_S = 6.0, 2.0
SPARSE = 10  # ticks from one angle to the next, of which the ripple is made
AT = {name: k for k, name in enumerate(TRACE)}


def _ticks(seconds: float) -> int:
    return round(seconds / TICK_S)


def speeds(rig: RigFile, drawn: Truth, asked: SpeedsAsked) -> Mapping[str, Mapping[str, float]]:
    """By sharing: `speed` rad/s, mean of both directions, `bound` A of the torque current, and `ripple` rad/s, the rms of the
    speed's orders 1 to 4."""
    plant = Plant(_drifted(drawn.plant, asked.at_s), drawn.noise ^ OTHER_NOISE)
    parameters = Parameters(rig, drawn, plant)

    def write(values: Numbers) -> None:
        for name, value in values.items():
            parameters.set(name, value, True, True)

    write(asked.settings)
    for mode, seconds in ((core.READY, 0.5), (core.LIFT, parameters.own["lift_time_s"]), (core.LEVITATE, 2.0)):
        plant.mode = mode
        plant.run(_ticks(seconds))
    for values in asked.before:
        write(values)
        plant.run(_ticks(SETTLE_S / 2))
    found: dict[str, list[tuple[float, float, float]]] = {name: [] for name in asked.sharings}
    for way in (1, -1):
        plant.set("speed_ref", way * asked.guard)
        for name, values in asked.sharings.items():
            write(values)
            plant.run(_ticks(SETTLE_S))
            found[name].append(_watched(plant, asked.seconds, way))
    return {
        name: dict(zip(("speed", "bound", "ripple"), np.mean(both, axis=0).tolist(), strict=True))
        for name, both in found.items()
    }


def _drifted(p: PlantParams, at_s: float) -> PlantParams:
    """With its current sensors as they are at a time, for good: 1e-4 A are more than what a run leaves open."""

    def offsets(zero: tuple[float, ...], rate: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(z + r * at_s for z, r in zip(zero, rate, strict=True))

    segments = offsets(p.segment_offset, p.segment_drift)
    return replace(
        p, current_offset=offsets(p.current_offset, p.current_drift), current_drift=(0.0,) * len(p.current_drift),
        segment_offset=(segments[0], segments[1], segments[2], segments[3]), segment_drift=(0.0,) * 4,
    )  # fmt: skip


def _watched(plant: Plant, seconds: float, way: int) -> tuple[float, float, float]:
    """Over whole turns: what swings with the turn has another mean over a part of one."""
    began = _angle(plant)
    plant.run(_ticks(1.0))
    turn_s = 2 * math.pi / abs(_angle(plant) - began)
    left = total = _ticks(max(1, round(seconds / turn_s)) * turn_s)
    began, bounds, angles = _angle(plant), 0.0, []
    while left > 0:
        trace = plant.run(min(left, _ticks(CHUNK_S)), 1)[1]
        bounds += float(trace[:, AT["torque_bound"]].sum())
        angles.append(trace[::SPARSE, AT["angle"]])
        left -= len(trace)
    return way * (_angle(plant) - began) / (total * TICK_S), bounds / total, _ripple(np.concatenate(angles))


def _angle(plant: Plant) -> float:
    return float(plant.state()["s"][5])


def _ripple(read: Array) -> float:
    """Of angles as they are read, counts and all: in 40 s these leave less than 1 mrad/s."""
    angle = np.unwrap(read)
    rates, between = np.diff(angle) / (SPARSE * TICK_S), (angle[1:] + angle[:-1]) / 2
    orders = [w(n * between) for n in range(1, 5) for w in (np.cos, np.sin)]
    terms: Array = np.linalg.lstsq(np.column_stack([np.ones_like(between), *orders]), rates, rcond=None)[0][1:]
    return math.sqrt(float((terms**2).sum()) / 2)
