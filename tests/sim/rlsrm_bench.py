"""The rotary-linear motor on a bench: R's experiments, drawn machines, what tests take from rows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sim_backend.core.plant import Array
from sim_backend.machines.rlsrm.params import DEG, ControlParams, Map, Pair, PlantParams
from sim_backend.machines.rlsrm.plant import TRACE, Plant

COLUMN = {name: k for k, name in enumerate(TRACE)}
OFF = (1.0, -0.6, 0.2, -0.9, 0.5, -0.2)
"""How phases share an error of the map: mean zero, the largest one."""
SHAPED = ControlParams(speed=(0.08, 6.0), rise=(0.3, 20.0))
RESTLESS = {"ki": (0.0, 0.0)}
"""Loops without integrators."""


def column(rows: Array, *names: str) -> Array:
    return rows[:, [COLUMN[n] for n in names]].squeeze()


def wrong_map(share: float, angle: float, centre: float) -> PlantParams:
    """A machine whose map is not the one its controller has: phases by a share, stators by an angle, the centre by a length."""
    known = Map(gain=tuple(1 + share * e for e in OFF), zero=(angle, -0.5 * angle), centre=centre)
    return PlantParams(map=known)


TYPICAL = wrong_map(0.02, 0.3 * DEG, 0.2e-3)


def drawn(seed: int) -> PlantParams:
    """A machine within the tolerances of the design; its controller keeps the nominal map."""
    r = np.random.default_rng(seed)

    def u(half: float) -> float:
        return float(r.uniform(-half, half))

    known = Map(
        gain=tuple(1 + u(0.03) for _ in range(6)), zero=(u(0.4) * DEG, u(0.4) * DEG), centre=u(3e-4), c2=0.0301 + u(0.02),
        c3=0.0859 + u(0.02), unaligned=0.15 * (1 + u(0.1)), fringe=1.5e-3 * (1 + u(0.2)), saturation=8.5 * (1 + u(0.05)),
        uneven=abs(u(0.02)), uneven_phase=u(math.pi), slope=0.79 + u(0.024), leakage=1.5e-3 + u(2e-4),
    )  # fmt: skip
    return PlantParams(
        map=known, inertia=1.5e-3 * (1 + u(0.05)), mass=3.35 * (1 + u(0.01)), viscous=(4 * (1 + u(0.3)), 2e-3 * (1 + u(0.3))),
        coulomb=1.5 * (1 + u(0.3)), current_gain=tuple(1 + u(0.005) for _ in range(6)),
        current_offset=tuple(u(0.02) for _ in range(6)), resistance=tuple(7.8 * (1 + u(0.03)) for _ in range(6)),
        ambient=30 + u(10), supply=90 + u(2), scale=u(3e-5), once=(0.05 + u(0.03)) * DEG, once_phase=u(math.pi),
        tilt=u(1e-3), edge=(u(0.5), u(0.5)),
    )  # fmt: skip


def flown(params: PlantParams, control: ControlParams, seconds: float, at: Pair = (0.0, 0.0)) -> Array:
    """Both loops closed where the mover is; a row each millisecond."""
    plant = Plant(params, control)
    plant.put(*at)
    plant.switch(on=True, x=True, angle=True)
    return plant.run(seconds)


def sine(control: ControlParams, axis: int, amplitude: float, period: float = 5.0, **other: object) -> ControlParams:
    """A set point of one axis as a sine; `both` gives the other one, too."""
    pair = (1.0, 0.0) if axis == 0 else (0.0, 1.0)
    return replace(control, wave=pair, amplitude=(amplitude, amplitude), period=(period, period), **other)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Stepped:
    """Of one transition: overshoot as a share of the step, error in the mean of the last 0.2 s, time to 2 %, s."""

    overshoot: float
    error: float
    settled: float


def squares(rows: Array, axis: str, period: float) -> tuple[Stepped, Stepped]:
    """The transitions up and down of the last period that is whole."""
    ref, true = column(rows, f"ref_{axis}"), column(rows, f"true_{axis}")
    half = round(period * 500)
    start = (len(rows) // (2 * half) - 1) * 2 * half
    return tuple(_stepped(ref[s : s + half], true[s : s + half]) for s in (start, start + half))  # type: ignore[return-value]


def _stepped(ref: Array, true: Array) -> Stepped:
    end, step = ref[-1], ref[-1] - true[0]
    outside = np.flatnonzero(abs(true - end) > 0.02 * abs(step))
    return Stepped(
        float(((true - end) * np.sign(step)).max() / abs(step)), float((ref - true)[-200:].mean()),
        float(outside[-1] + 1 if len(outside) else 0) * 1e-3,
    )  # fmt: skip


@dataclass(frozen=True)
class Loaded:
    """After a load on one axis: the largest error since it came, and in the mean of the last 0.1 s."""

    peak: float
    left: float


def loaded(params: PlantParams, control: ControlParams, axis: str, loads: Pair, at: Pair) -> Loaded:
    """R Fig. 13: sent to a place, the first load at 1.6 s, the second at 2.3 s, both against the axis, 5 s in all."""
    plant = Plant(params, control)
    plant.switch(on=True, x=True, angle=True)
    plant.refer(*at)
    plant.run(1.6)
    for load in loads:
        plant.push(*((-load, 0.0) if axis == "x" else (0.0, -load)))
        rows = plant.run(0.7 if load is loads[0] else 2.7)
    error = column(rows, f"ref_{axis}") - column(rows, f"true_{axis}")
    return Loaded(float(abs(error).max()), float(abs(error[-100:].mean())))
