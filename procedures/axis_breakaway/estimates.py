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
from procedures.axis_breakaway.alone import Bearing, alone, bearing, circle, inertia
from procedures.axis_breakaway.fit import Axis
from procedures.axis_breakaway.plan import Plan
from procedures.axis_breakaway.sequence import PULLS, WAYS, chosen, loads, mass, pair, seen
from procedures.axis_breakaway.steps import Ramp
from procedures.axis_friction.fit import pseudo
from procedures.stages.known_loads import force, load_inputs
from procedures.stages.map_bends import doubts
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
    of axes that were pulled beside, what `alone.circle` gives; `estimates` by name and where."""

    data: Data
    at: Mapping[str, float]
    beyond: Mapping[str, float]
    shares: Array
    beside: Mapping[str, tuple[Array, Array]]
    estimates: dict[tuple[str, str], Estimate] = field(default_factory=dict)


def named(axis: StageAxis) -> str:
    """A quantity's name for an axis in m or rad."""
    return f"{BREAKAWAY}_angle" if turns(axis) else BREAKAWAY


def arrays(ramps: Sequence[Ramp], rig: RigFile, plan: Plan) -> Data:
    """Ramps as `alone` gives them by axis, load and repeat.

    Raises:
        AnalysisError: some are missing.
    """
    of, axes = {a.name: a for a in chosen(rig, plan)}, {}
    for name, axis in of.items():
        each: dict[tuple[str, int], Array] = {}
        for load in ("", *(s.name for s in loads(rig, axis))):
            for way in WAYS:
                found = [_one(ramps, axis=name, load=load, way=way, repeat=k, turned=0) for k in range(plan.repeats)]
                each[load, way] = np.array([r.force[name] for r in found])
        down, up = ((each[s.name, 1] + each[s.name, -1]) / 2 for s in sorted(loads(rig, axis), key=lambda s: s.sign))
        axes[name] = Axis(each["", 1], each["", -1], down, up)
    both = pair(rig, plan)
    helix = None if both is None else _helix(ramps, both, plan)
    return Data(of, axes, helix, plan.helix if helix is not None else (), plan.repeats)


def _one(ramps: Sequence[Ramp], **wanted: object) -> Ramp:
    found = [r for r in ramps if all(getattr(r, k) == v for k, v in wanted.items())]
    if len(found) != 1:
        said = ", ".join(f"{k} {v}" for k, v in wanted.items())
        raise AnalysisError(f"{said}: found {len(found)} ramps; expected 1 (was the run stopped early?)")
    return found[0]


def _helix(ramps: Sequence[Ramp], both: tuple[StageAxis, StageAxis], plan: Plan) -> Array:
    out = np.empty((plan.repeats, len(plan.helix), 4, 2))
    for k in range(plan.repeats):
        for j, share in enumerate(plan.helix):
            for m, (way, turned) in enumerate((w, t) for w in WAYS for t in WAYS):
                one = _one(ramps, share=share, repeat=k, way=way, turned=turned)
                out[k, j, m] = [one.force[a.name] for a in both]
    return out


def late_by(b: Bearing, rig: RigFile, plan: Plan) -> dict[str, float]:
    """Of each axis, the greatest force by which a count delays what is seen of it, with nothing beside."""
    return {a.name: fit.beyond(inertia(a, rig), seen(a), b.rise[a.name]) for a in chosen(rig, plan)}


def results(ramps: Sequence[Ramp], rig: RigFile, plan: Plan) -> Result:
    """Everything.

    Raises:
        AnalysisError: ramps are missing.
    """
    b = bearing(ramps, rig, plan)
    most, data = late_by(b, rig, plan), arrays(alone(ramps, rig, plan, b), rig, plan)
    inputs: dict[str, Estimate] = {}
    for axis in data.of.values():
        inputs |= load_inputs(rig, loads(rig, axis), (mass(axis, plan),))
    values = {name: e.value for name, e in inputs.items()}
    whole = np.arange(plan.repeats)
    at = _vector(data, rig, plan, values, whole)
    each = pseudo([_vector(data, rig, plan, values, np.delete(whole, k)) for k in whole], at)
    names = _names(data)
    told = propagate(lambda p: dict(zip(map("@".join, names), _vector(data, rig, plan, p, whole), strict=True)), inputs)
    doubted = _by_doubts(ramps, rig, plan, b, values, at) | _by_bends(ramps, rig, plan, b, values, at)
    counted = {
        own: (_by_count(data, rig, plan, values, own, by) - at) / by
        for own, width in most.items()
        if (by := fit.DEVIATION * width) > 0
    }
    times = {own: len(WAYS) * plan.repeats * (len(PULLS) if (own, 1) in b.bends else 1) for own in most}
    out = {}
    for j, (name, where) in enumerate(names):
        unit = "1" if name == SHARE else data.of[where].force
        u = float(each[:, j].std(ddof=1)) / math.sqrt(plan.repeats)
        e = told["@".join((name, where))] + _scatter(f"{name}/{where}", u, unit, plan.repeats - 1.0)
        for influence, slope in doubted.items():
            e = e + Estimate(0.0, "", {influence: float(slope[j])})
        for own, slopes in counted.items():
            e = e + _count(data.of[own], most[own], times[own], float(slopes[j]))
        out[name, where] = Estimate(e.value, unit, e.sensitivities)
    alone_at = {a: float(at[j]) for j, a in enumerate(data.of)}
    return Result(data, alone_at, most, at[len(data.of) :], circle(ramps, rig, plan, b), out)


def _scatter(identity: str, u: float, unit: str, dof: float) -> Estimate:
    return Estimate.of(0.0, Influence(f"scatter/{identity}", "scatter of the repeats", u, unit, "A", "normal", dof))


def _count(axis: StageAxis, most: float, ramps: int, slope: float) -> Estimate:
    """Where in its count an axis sticks before each of so many ramps is known to nobody: `slope` for each N or N m by which a
    count delays it in the mean. The slide before a ramp leaves it anywhere in a count, so that they are off each by itself."""
    u = fit.DEVIATION * most / math.sqrt(ramps)
    if u == 0:
        return Estimate.exact(0.0)
    known = Influence(f"counts/{axis.name}", f"where in a count {axis.name} sticks", u, axis.force, "B", "normal")
    return Estimate(0.0, "", {known: slope})


def _by_count(data: Data, rig: RigFile, plan: Plan, p: Mapping[str, float], axis: str, by: float) -> Array:
    """With all forces of an axis nearer to nothing by so much."""
    a = data.axes[axis]
    axes = {**data.axes, axis: replace(a, plus=a.plus - by, minus=a.minus + by)}
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


def _by_doubts(ramps: Sequence[Ramp], rig: RigFile, plan: Plan, b: Bearing, p: Mapping[str, float], at: Array
               ) -> dict[Influence, Array]:  # fmt: skip
    """Sensitivities of the results to what bends the map, as in `axis_friction.estimates`."""
    out: dict[Influence, Array] = {}
    for k, influence in enumerate(doubts(rig, plan.saturation_share)):
        if influence.u > 0:
            moved = [replace(r, force={a: f + influence.u * r.moves[a][k] for a, f in r.force.items()}) for r in ramps]
            data = arrays(alone(moved, rig, plan, b), rig, plan)
            out[influence] = (_vector(data, rig, plan, p, np.arange(plan.repeats)) - at) / influence.u
    return out


def _by_bends(ramps: Sequence[Ramp], rig: RigFile, plan: Plan, b: Bearing, p: Mapping[str, float], at: Array
              ) -> dict[Influence, Array]:  # fmt: skip
    """Likewise to how much an axis' friction bends with what acts beside, as a share."""
    out: dict[Influence, Array] = {}
    for (name, way), bent in b.bends.items():
        if bent.u > 0:
            more = {**b.bends, (name, way): replace(bent, limit=bent.limit / math.sqrt(1 + bent.u))}
            data = arrays(alone(ramps, rig, plan, b, more), rig, plan)
            about = f"what acts beside takes off {name} {'up' if way > 0 else 'down'}, share"
            known = Influence(f"bend/{name}/{'up' if way > 0 else 'down'}", about, bent.u, "1", "A", "normal")
            out[known] = (_vector(data, rig, plan, p, np.arange(plan.repeats)) - at) / bent.u
    return out
