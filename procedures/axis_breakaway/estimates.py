"""Breakaway of each axis, and of both at once as a share of one friction along the path, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis
from bench.uncertainty import Estimate, Influence, propagate
from procedures.axis_breakaway import fit
from procedures.axis_breakaway.fit import Axis
from procedures.axis_breakaway.plan import Plan
from procedures.axis_breakaway.sequence import WAYS, chosen, loads, mass, pair, seen
from procedures.axis_breakaway.steps import Ramp
from procedures.axis_friction.fit import pseudo
from procedures.stages.known_loads import force, load_inputs
from procedures.stages.map_bends import doubts
from procedures.stages.pairs import MACHINE
from procedures.stages.spread import turns

Array = npt.NDArray[np.float64]
BREAKAWAY, SHARE = "breakaway", "path_share"


@dataclass(frozen=True)
class Data:
    """As arrays by axis; helices (n, h, 4, 2), repeats, shares, ways, forces along and around; None without."""

    of: Mapping[str, StageAxis]
    axes: Mapping[str, Axis]
    helix: Array | None
    shares: tuple[float, ...]
    repeats: int


@dataclass(frozen=True)
class Result:
    """By axis what it breaks away at, N or N m, and the greatest force by which a count delays that; shares of helices (h,);
    `estimates` by name and where."""

    data: Data
    at: Mapping[str, float]
    beyond: Mapping[str, float]
    shares: Array
    estimates: dict[tuple[str, str], Estimate] = field(default_factory=dict)


def named(axis: StageAxis) -> str:
    """A quantity's name for an axis in m or rad."""
    return f"{BREAKAWAY}_angle" if turns(axis) else BREAKAWAY


def arrays(ramps: Sequence[Ramp], rig: RigFile, plan: Plan, late: Mapping[str, float]) -> Data:
    """Ramps by axis, load and repeat, forces less what a count has them go on by.

    Raises:
        AnalysisError: some are missing.
    """
    of, axes = {a.name: a for a in chosen(rig, plan)}, {}
    for name, axis in of.items():
        each: dict[tuple[str, int], Array] = {}
        for load in ("", *(s.name for s in loads(rig, axis))):
            for way in WAYS:
                found = [_one(ramps, axis=name, load=load, way=way, repeat=k, turned=0) for k in range(plan.repeats)]
                each[load, way] = np.array([r.force[name] - way * late[name] for r in found])
        down, up = ((each[s.name, 1] + each[s.name, -1]) / 2 for s in sorted(loads(rig, axis), key=lambda s: s.sign))
        axes[name] = Axis(each["", 1], each["", -1], down, up)
    both = pair(rig, plan)
    helix = None if both is None else _helix(ramps, both, plan, late)
    return Data(of, axes, helix, plan.helix if helix is not None else (), plan.repeats)


def _one(ramps: Sequence[Ramp], **wanted: object) -> Ramp:
    found = [r for r in ramps if all(getattr(r, k) == v for k, v in wanted.items())]
    if len(found) != 1:
        said = ", ".join(f"{k} {v}" for k, v in wanted.items())
        raise AnalysisError(f"{said}: found {len(found)} ramps; expected 1 (was the run stopped early?)")
    return found[0]


def _helix(ramps: Sequence[Ramp], both: tuple[StageAxis, StageAxis], plan: Plan, late: Mapping[str, float]) -> Array:
    out = np.empty((plan.repeats, len(plan.helix), 4, 2))
    for k in range(plan.repeats):
        for j, share in enumerate(plan.helix):
            for m, (way, turned) in enumerate((w, t) for w in WAYS for t in WAYS):
                one = _one(ramps, share=share, repeat=k, way=way, turned=turned)
                force = np.array([one.force[a.name] for a in both])
                out[k, j, m] = force - np.sign(force) * [late[a.name] for a in both]
    return out


def late_by(ramps: Sequence[Ramp], rig: RigFile, plan: Plan) -> dict[str, float]:
    """Of each axis, the greatest force by which a count delays what is seen of it."""
    out = {}
    for axis in chosen(rig, plan):
        rises = [abs(r.rises[axis.name]) for r in ramps if r.axis == axis.name and not r.turned]
        number, count = rig.machine.get(MACHINE[axis.unit]), seen(axis)
        out[axis.name] = fit.beyond(
            0.0 if number is None else number.value, count, float(np.median(rises)) if rises else 0.0
        )
    return out


def results(ramps: Sequence[Ramp], rig: RigFile, plan: Plan) -> Result:
    """Everything.

    Raises:
        AnalysisError: ramps are missing.
    """
    most = late_by(ramps, rig, plan)
    late = {name: fit.MEAN * value for name, value in most.items()}
    data = arrays(ramps, rig, plan, late)
    inputs: dict[str, Estimate] = {}
    for axis in data.of.values():
        inputs |= load_inputs(rig, loads(rig, axis), (mass(axis, plan),))
    values = {name: e.value for name, e in inputs.items()}
    whole = np.arange(plan.repeats)
    at = _vector(data, rig, plan, values, whole)
    each = pseudo([_vector(data, rig, plan, values, np.delete(whole, k)) for k in whole], at)
    names = _names(data)
    told = propagate(lambda p: dict(zip(map("@".join, names), _vector(data, rig, plan, p, whole), strict=True)), inputs)
    bends = _by_doubts(ramps, rig, plan, late, values, at)
    out = {}
    for j, (name, where) in enumerate(names):
        unit = "1" if name == SHARE else data.of[where].force
        u = float(each[:, j].std(ddof=1)) / math.sqrt(plan.repeats)
        e = told["@".join((name, where))] + _scatter(f"{name}/{where}", u, unit, plan.repeats - 1.0)
        for influence, slope in bends.items():
            e = e + Estimate(0.0, "", {influence: float(slope[j])})
        for own, width in most.items():
            moves = float(_by_count(data, rig, plan, values, own, width)[j] - at[j])
            e = e + _count(data.of[own], width, moves)
        out[name, where] = Estimate(e.value, unit, e.sensitivities)
    return Result(data, {a: float(at[j]) for j, a in enumerate(data.of)}, most, at[len(data.of) :], out)


def _scatter(identity: str, u: float, unit: str, dof: float) -> Estimate:
    return Estimate.of(0.0, Influence(f"scatter/{identity}", "scatter of the repeats", u, unit, "A", "normal", dof))


def _count(axis: StageAxis, width: float, moves: float) -> Estimate:
    """Where in its count an axis sticks is known to nobody, N or N m: `moves` for half the width."""
    u = width / math.sqrt(12)
    if u == 0:
        return Estimate.exact(0.0)
    known = Influence(f"counts/{axis.name}", f"where in a count {axis.name} sticks", u, axis.force, "B", "rectangular")
    return Estimate(0.0, "", {known: moves / (width / 2)})


def _by_count(data: Data, rig: RigFile, plan: Plan, p: Mapping[str, float], axis: str, width: float) -> Array:
    """With all forces of an axis by half the width nearer to nothing."""
    a = data.axes[axis]
    axes = {**data.axes, axis: replace(a, plus=a.plus - width / 2, minus=a.minus + width / 2)}
    return _vector(replace(data, axes=axes), rig, plan, p, np.arange(data.repeats))


def _names(data: Data) -> list[tuple[str, str]]:
    return [*((named(a), name) for name, a in data.of.items()), *((SHARE, f"{s:g}") for s in data.shares)]


def _vector(data: Data, rig: RigFile, plan: Plan, p: Mapping[str, float], take: fit.Take) -> Array:
    """Breakaway of each axis, and shares of helices."""
    weights = {name: _weights(rig, axis, plan, p) for name, axis in data.of.items()}
    at = {name: fit.breakaway(a, weights[name], take) for name, a in data.axes.items()}
    if data.helix is None:
        return np.array([*at.values()])
    both = [name for way in (False, True) for name, a in data.of.items() if turns(a) is way][:2]
    parts = []
    for k, name in enumerate(both):
        up, down = fit.newtons(data.axes[name], weights[name], take)
        f = data.helix[take, :, :, k]
        parts.append(np.where(f > 0, up * f, down * f) / at[name])
    shares = np.hypot(*parts).mean(axis=(0, 2))
    return np.array([*at.values(), *shares])


def _weights(rig: RigFile, axis: StageAxis, plan: Plan, p: Mapping[str, float]) -> tuple[float, float]:
    by = {s.sign: s for s in loads(rig, axis)}
    return -force(by[-1], mass(axis, plan), p), force(by[1], mass(axis, plan), p)


def _by_doubts(ramps: Sequence[Ramp], rig: RigFile, plan: Plan, late: Mapping[str, float], p: Mapping[str, float], at: Array
               ) -> dict[Influence, Array]:  # fmt: skip
    """Sensitivities of the results to what bends the map, as in `axis_friction.estimates`."""
    out: dict[Influence, Array] = {}
    for k, influence in enumerate(doubts(rig, plan.saturation_share)):
        if influence.u > 0:
            moved = [replace(r, force={a: f + influence.u * r.moves[a][k] for a, f in r.force.items()}) for r in ramps]
            data = arrays(moved, rig, plan, late)
            out[influence] = (_vector(data, rig, plan, p, np.arange(plan.repeats)) - at) / influence.u
    return out
