"""What a mission truly is on a drawn machine: the same machine and firmware, flown by the same commands with sensors that have
no noise and no rounding."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from bench.rigfile import RigFile
from sim_backend.core.plant import Array
from sim_backend.machine import Truth
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.plant import STATES, TICKS_S, TRACE, Plant
from sim_backend.machines.lira.settings import BY_NAME
from sim_backend.mission_motion import MissionAsked

RADIAL: Final = ("x1", "x2", "y1", "y2")
KEPT: Final = (*RADIAL, "z", "angle", "true_z", "true_angle", "mode")
COLUMNS: Final = [TRACE.index(name) for name in KEPT]
BEAT_S: Final = 0.02
STEP_S: Final = 1 / 35_000


def quiet(p: PlantParams) -> PlantParams:
    """With sensors that have neither noise nor rounding; lag, gains and zeros stay."""
    return replace(
        p, position_noise=(0.0,) * 6, position_lsb=(0.0,) * 6, bridge_noise=0.0, bridge_lsb=0.0, coil_noise=0.0,
        coil_lsb=0.0, voltage_noise=0.0, voltage_lsb=0.0,
    )  # fmt: skip


def mission(rig: RigFile, drawn: Truth, asked: MissionAsked) -> Mapping[tuple[str, str], float]:
    """Every quantity by name and place; nothing where it does not fly."""
    del rig
    built = drawn.plant
    flight = _flown(drawn, asked)
    if flight is None:
        return {}
    passed, t, rows = flight
    p: PlantParams = built.plant
    out: dict[tuple[str, str], float] = {("lift_time", ""): passed - asked.lift_s}
    at = {name: rows[:, KEPT.index(name)] for name in KEPT}
    gate = (t > passed - asked.gate_s) & (t <= passed)
    for k, probe in enumerate(RADIAL):
        x = at[probe] / p.position_gain[k]
        repeats = [x[(t >= a) & (t < b)] for a, b in asked.repeats]
        out["peak_reading", probe] = max(float(np.abs(r).max()) for r in repeats)
        out["swing", probe] = max(float(np.ptp(r)) for r in repeats)
        back, there = (_means(x, t, asked, k) for k in (0, 1))
        out["level_difference", probe] = there - back
        out["gate_margin", probe] = asked.gate_m - float(np.abs(at[probe][gate]).max())
    for k, where in enumerate(asked.places):
        out["place_error", where] = _means(at["true_z"], t, asked, k) - asked.sent[k][0]
        out["angle_error", where] = _means(at["true_angle"], t, asked, k) - asked.sent[k][1]
    return out


def _means(x: Array, t: Array, asked: MissionAsked, there: int) -> float:
    """Mean at rest at one of the places."""
    return float(np.mean([x[(t >= a) & (t < b)].mean() for a, b, k in asked.rests if k == there]))


def _flown(drawn: Truth, asked: MissionAsked) -> tuple[float, Array, Array] | None:
    """When the gate passed, times (n,), both s from the firmware's start on, and rows (n, len(KEPT))."""
    built: Any = drawn.plant
    plant = drawn.machine.make(replace(built, plant=quiet(built.plant)), drawn.noise, 1)
    assert isinstance(plant, Plant)
    for name, value in asked.settings.items():
        if name in BY_NAME:
            plant.set(BY_NAME[name].field, value)
    done: list[tuple[float, str, Sequence[float]]]
    done = [(asked.on_s, "on", ()), (asked.lift_s, "lift", ()), (asked.end_s, "", ())]
    done += [(when, axis, where) for when, axis, *where in asked.commands]
    rows = []
    for when, what, where in sorted(done, key=lambda c: c[0]):
        rows.append(_run(plant, when - plant.tick / TICKS_S))
        if what == "lift":
            _lay(plant, built.plant, rows[-1][-1], asked.lying)
        if not _told(plant, what, where):
            return None
    whole = np.concatenate(rows)
    t = np.arange(float(len(whole))) * STEP_S
    held = np.flatnonzero(whole[:, KEPT.index("mode")] == STATES.index("LEVITATED"))
    if not len(held) or plant.state != "LEVITATED":
        return None
    return float(t[held[0]]), t, whole


def _lay(plant: Plant, p: PlantParams, row: Array, lying: Mapping[str, float]) -> None:
    """Put the mover where it was read to lie before the lift: in its rings it rests where it was left, within friction."""
    x, y, alpha, beta, z, _ = plant.place[:6]
    off = {n: (lying[n] - row[KEPT.index(n)]) / p.position_gain[k] for k, n in enumerate((*RADIAL, "z"))}
    lever, wide = p.middle - z, 2 * p.sensor_plane
    turned = {"beta": (off["x1"] - off["x2"]) / wide, "alpha": -(off["y1"] - off["y2"]) / wide}
    plant.put(
        x=x + (off["x1"] + off["x2"]) / 2 - turned["beta"] * lever,
        y=y + (off["y1"] + off["y2"]) / 2 + turned["alpha"] * lever,
        alpha=alpha + turned["alpha"], beta=beta + turned["beta"], z=z + off["z"],
    )  # fmt: skip


def _told(plant: Plant, what: str, where: Sequence[float]) -> bool:
    """Whether the firmware does it."""
    if what == "on":
        plant.command("idle")
    if what in ("on", "lift"):
        return plant.command(what) == 0
    if what:
        plant.go(what, *where)
    return True


def _run(plant: Plant, seconds: float) -> Array:
    return np.concatenate([np.empty((0, len(KEPT))), *_pieces(plant, seconds)])


def _pieces(plant: Plant, seconds: float) -> Iterator[Array]:
    left = round(seconds / STEP_S)
    while left > 0:
        plant.beat()
        count = min(left, round(BEAT_S / STEP_S))
        yield plant.run(count * STEP_S)[:, COLUMNS]
        left -= count
