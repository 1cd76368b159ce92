"""How the drawn motor truly answers loads: the same approaches and changes of load, at more set points within a count.

Deviations are as the encoder sees them before it counts, so that its zero is in none. What friction holds is half of what the
motor's true forces at rest differ by, upwards and downwards, and half a count's force, as a slow axis stops within one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from bench.rigfile import RigFile
from sim_backend.core.plant import Array
from sim_backend.loads_motion import LoadedAxis, LoadsAsked
from sim_backend.machine import Truth
from sim_backend.machines.rlsrm.device import StagePlant, control_of
from sim_backend.machines.rlsrm.operator import Attendant
from sim_backend.machines.rlsrm.params import PlantParams
from sim_backend.machines.rlsrm.plant import AXES, TRACE
from sim_backend.machines.rlsrm.served import Served

AT_REST, CHANGED = 2, 4  # times the plan's set points within a count, between which they lie
GOLDEN: Final = 0.6180339887
FORCES: Final = ("force", "torque")
SPARE_S: Final = 0.1
ANSWERS_S: Final = 0.15  # after a load begins to be let go, until a reading shows it


@dataclass(frozen=True)
class Stand:
    """A motor that is held, its attendant, and where its set points are."""

    core: Served
    attendant: Attendant
    params: PlantParams
    at: dict[str, float]

    def go(self, asked: LoadsAsked, axis: LoadedAxis, at: float, slowly: bool = False) -> None:
        """To a set point, and wait until it is there and still."""
        rate = axis.slow if slowly else axis.rate
        self.core.set("speed", rate, axis.name)
        self.core.refer(**{axis.name: at})
        far = abs(at - self.at[axis.name])
        self.at[axis.name] = at
        self.core.run(far / rate + rate / axis.rise + asked.settle_s, every=0)

    def hang(self, source: str, label: str, turns: bool) -> None:
        """A mass, or "" for nothing."""
        self.attendant.request(f"{'lever' if turns else 'hang'} {source} {label or '-'}")

    def deviation(self, rows: Array, axis: str) -> Array:
        """What the encoder sees, without counts, less the set point."""
        p, k = self.params, AXES.index(axis)
        true = rows[:, TRACE.index(f"true_{axis}")]
        seen = true * (1 + p.scale) if k == 0 else true + p.once * np.sin(true - p.once_phase)
        return np.asarray(seen + p.edge[k] * p.pitch[k] - rows[:, TRACE.index(f"ref_{axis}")])


def loads(rig: RigFile, drawn: Truth, asked: LoadsAsked) -> dict[tuple[str, str], float]:
    """By quantity and where, as load-response names them; of axes around with another name."""
    out: dict[tuple[str, str], float] = {}
    for axis in asked.axes:
        if asked.static:
            out |= _static(_stand(rig, drawn, asked, asked.without), drawn, asked, axis)
        if asked.disturbed:
            out |= _disturbed(_stand(rig, drawn, asked, asked.settings), asked, axis)
    return out


def _stand(rig: RigFile, drawn: Truth, asked: LoadsAsked, settings: Mapping[str, float]) -> Stand:
    told = {name: value * drawn.defects.get(f"factor_{name}", 1.0) for name, value in settings.items()}
    plant = StagePlant(drawn.plant, drawn.seed)
    plant.core = core = Served(drawn.plant.plant, control_of(told))
    core.switch(on=True, x=True, angle=True)
    core.run(asked.settle_s, every=0)
    return Stand(core, Attendant(rig, plant, drawn), drawn.plant.plant, dict.fromkeys(AXES, 0.0))


def _static(s: Stand, drawn: Truth, asked: LoadsAsked, axis: LoadedAxis) -> dict[tuple[str, str], float]:
    points = AT_REST * asked.phases
    found, before = [], ""
    for point in range(points):
        for source, label, sign in axis.loads:
            if before and before != source:
                s.hang(before, "", axis.turns)
            if source:
                s.hang(source, label, axis.turns)
            before = source
            _others(s, asked, axis, point, points)
            ends = [_approached(s, asked, axis, (point + 0.5) / points * axis.pitch, side) for side in (1, -1)]
            found.append((_newtons(drawn, axis, source, label, sign), *np.ravel(ends)))
        s.core.run(asked.cool_s, every=0)
    table = np.array(found)
    # up and down: true deviation, given, force
    force, up, down = table[:, 0], table[:, 1:4], table[:, 4:7]
    away = force - force.mean()
    slope = [float(away @ (up + down)[:, j] / 2 / (away @ away)) for j in range(2)]
    held = float(np.mean(up[:, 2] - down[:, 2])) / 2 + axis.pitch / 2 / slope[0]
    apart = (
        float(np.mean(down[:, 1] - up[:, 1])) / 2 * slope[0] / slope[1]
    )  # by the forces that the loop asked for: as it reads
    rubs = np.mean([_rubs(drawn, axis, source, label) for source, label, _ in axis.loads])
    names = _names(axis)
    return {(names[0], axis.name): slope[0], (names[1], axis.name): apart + axis.pitch / 2,
            (names[2], axis.name): held - float(rubs), ("force_scale", axis.name): -1 / slope[1]}  # fmt: skip


def _others(s: Stand, asked: LoadsAsked, axis: LoadedAxis, point: int, points: int) -> None:
    for other in (a for a in asked.all_axes if a.name != axis.name):
        at = (point + 0.5) / points * other.pitch
        s.go(asked, other, at + (1 if 2 * point < points else -1) * other.lead / 2)
        s.go(asked, other, at)


def _names(axis: LoadedAxis) -> tuple[str, str, str]:
    if axis.turns:
        return "compliance_angle", "friction_band_angle", "friction_torque"
    return "compliance", "friction_band", "friction"


def _approached(s: Stand, asked: LoadsAsked, axis: LoadedAxis, at: float, side: int) -> tuple[float, float, float]:
    """True deviation, force given by the controller's map, true force of the motor, at rest."""
    s.go(asked, axis, at - side * axis.lead)
    s.go(asked, axis, at, slowly=True)
    rows = s.core.run(asked.average_s)
    what = FORCES[AXES.index(axis.name)]
    true = rows[:, TRACE.index(f"true_{axis.name}")] - rows[:, TRACE.index(f"ref_{axis.name}")]
    given, force = (rows[:, TRACE.index(name)] for name in (f"given_{what}", what))
    return float(true.mean()), float(given.mean()), float(force.mean())


def _newtons(drawn: Truth, axis: LoadedAxis, source: str, label: str, sign: int) -> float:
    if not source:
        return 0.0
    if axis.turns:
        _, newtons, arm = drawn.on_lever(source, label)
        return newtons * arm
    _, newtons = drawn.load(label)
    return float(sign * newtons * np.cos(drawn.values[f"hooks.{source}.pulley.misalignment"]))


def _rubs(drawn: Truth, axis: LoadedAxis, source: str, label: str) -> float:
    if not source or axis.turns:
        return 0.0
    return abs(drawn.values[f"hooks.{source}.pulley.friction"]) * drawn.load(label)[1]


def _disturbed(s: Stand, asked: LoadsAsked, axis: LoadedAxis) -> dict[tuple[str, str], float]:
    peak, left = ("peak_angle", "error_after_angle") if axis.turns else ("peak", "error_after")
    points, out = CHANGED * asked.phases, {}
    found: dict[str, list[tuple[float, float]]] = {}
    for point in range(points):
        at = (point + 0.5) / points * axis.pitch
        _others(s, asked, axis, point, points)
        for source, label, sign in axis.changes:
            s.go(asked, axis, at + (1 if point % 2 else -1) * axis.lead)
            s.go(asked, axis, at)
            s.core.run(asked.rest_s * (1 + 0.5 * (point * GOLDEN % 1.0)), every=0)
            for on in (1, -1):
                s.hang(source, label if on > 0 else "", axis.turns)
                s.core.run(ANSWERS_S, every=0)
                way = on * sign * s.deviation(s.core.run(asked.after_s + asked.look_s), axis.name)
                late = round(asked.after_s * 1000)
                where = f"{axis.name}, {source}" + ("" if on > 0 else ", off")
                found.setdefault(where, []).append((float(way[:late].max()), float(way[late:].mean())))
                s.core.run(SPARE_S, every=0)
    for where, rows in found.items():
        out[peak, where], out[left, where] = (float(np.mean([row[j] for row in rows])) for j in (0, 1))
    return out
