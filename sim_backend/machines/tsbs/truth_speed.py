"""How fast the servomotor truly turns at its torque limit: the same machine under the same settings for a long time, with other
noise. The noise is part of it: what the law makes of it takes torque, so that a machine without it is another."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
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
SPARSE = 10  # ticks from one angle to the next, of which the speed is made
READ = [TRACE.index("angle"), TRACE.index("torque_bound")]


def _ticks(seconds: float) -> int:
    return round(seconds / TICK_S)


def speeds(rig: RigFile, drawn: Truth, asked: SpeedsAsked) -> Mapping[str, Mapping[str, float]]:
    """By sharing: `speed` rad/s, mean of both directions, `bound` A of the torque current, and `ripple` rad/s, the rms of the
    speed's orders 1 to 4. Each direction is watched with its sensors as they are when it was run: what drifts in between drives
    the rotor one way and does not drop out."""
    found: dict[str, list[tuple[float, float, float]]] = {name: [] for name in asked.sharings}
    for way, at_s in asked.at_s.items():
        plant, write = _carrying(rig, drawn, asked, at_s, OTHER_NOISE + way)
        plant.set("speed_ref", way * asked.guard)
        for name, values in asked.sharings.items():
            write(values)
            plant.run(_ticks(SETTLE_S))
            found[name].append(_watched(plant, asked.seconds, way))
    return {
        name: dict(zip(("speed", "bound", "ripple"), np.mean(both, axis=0).tolist(), strict=True))
        for name, both in found.items()
    }


def _carrying(
    rig: RigFile, drawn: Truth, asked: SpeedsAsked, at_s: float, noise: int
) -> tuple[Plant, Callable[[Numbers], None]]:
    """The machine of that time, its motor carrying, and what writes its parameters."""
    plant = Plant(_drifted(drawn.plant, at_s), drawn.noise ^ noise)
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
    return plant, write


def _drifted(p: PlantParams, at_s: float) -> PlantParams:
    """With its current sensors as they are at a time, for good: 1e-4 A are more than what a run leaves open."""

    def offsets(zero: tuple[float, ...], rate: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(z + r * at_s for z, r in zip(zero, rate, strict=True))

    segments, scale = offsets(p.segment_offset, p.segment_drift), 1 + p.segment_scale_drift * at_s
    gains = [scale * gain for gain in p.segment_sense]
    return replace(
        p, current_offset=offsets(p.current_offset, p.current_drift), current_drift=(0.0,) * len(p.current_drift),
        segment_offset=(segments[0], segments[1], segments[2], segments[3]), segment_drift=(0.0,) * 4,
        segment_sense=(gains[0], gains[1], gains[2], gains[3]), segment_scale_drift=0.0,
    )  # fmt: skip


def _watched(plant: Plant, seconds: float, way: int) -> tuple[float, float, float]:
    traces = [plant.run(_ticks(CHUNK_S), 1)[1][:, READ] for _ in range(max(1, round(seconds / CHUNK_S)))]
    angle, bounds = np.concatenate(traces).T
    return over_turns(way * np.unwrap(angle), bounds)


def over_turns(angle: Array, bounds: Array) -> tuple[float, float, float]:
    """Speed rad/s, mean bound A and ripple rad/s of unwrapped angles as they are read, growing, and bounds (n,) of every tick;
    over whole turns: what swings with the turn has another mean over a part of one, by 1e-5 of it even in 40 s."""
    turned = angle - angle[0]
    last = int(np.searchsorted(turned, 2 * math.pi * max(1, int(turned[-1] / (2 * math.pi)))))
    return _speed(turned[:last:SPARSE]), float(bounds[:last].mean()), _ripple(turned[:last])


def _speed(angle: Array) -> float:
    """Mean, of angles as they are read, counts and all."""
    drift = np.column_stack([_orders(angle), np.arange(len(angle)) * SPARSE * TICK_S])
    return float(np.linalg.lstsq(drift, angle, rcond=None)[0][-1])


def _ripple(angle: Array) -> float:
    """Of the angles of every tick: of every tenth, counts that beat with them look like an order, which moved ripples by up to
    0.2 mrad/s. By normal equations, whose columns are nearly at right angles: there are some 400 000 rows."""
    orders, rates = _orders((angle[1:] + angle[:-1]) / 2), np.diff(angle) / TICK_S
    terms = np.linalg.solve(orders.T @ orders, orders.T @ rates)[1:]
    return math.sqrt(float((terms**2).sum()) / 2)


def _orders(angle: Array) -> Array:
    """1, and cos and sin of each order, (n, 9)."""
    return np.column_stack([np.ones_like(angle), *(w(n * angle) for n in range(1, 5) for w in (np.cos, np.sin))])
