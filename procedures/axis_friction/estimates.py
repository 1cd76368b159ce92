"""Friction of each axis, and the radius that ties them, with influences."""

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
from procedures.axis_friction import fit
from procedures.axis_friction.fit import Axis, Friction, Helix
from procedures.axis_friction.plan import Plan
from procedures.axis_friction.sequence import WAYS, chosen, crossed, loads, mass, rates
from procedures.axis_friction.steps import Pass, those
from procedures.stages.known_loads import Source, force, load_inputs
from procedures.stages.map_bends import doubts
from procedures.stages.spread import turns

Array = npt.NDArray[np.float64]
COULOMB, VISCOUS, BIAS, RADIUS = "coulomb", "viscous", "one_sided", "friction_radius"
UNITS = {COULOMB: ("N", "N m"), VISCOUS: ("N s/m", "N m s/rad"), BIAS: ("N", "N m")}


@dataclass(frozen=True)
class Data:
    """What was recorded, as arrays by axis; `sources` that loaded each; the helix, None without; repeats."""

    axes: Mapping[str, Axis]
    of: Mapping[str, StageAxis]
    sources: Mapping[str, tuple[Source, ...]]
    helix: Helix | None
    pair: tuple[StageAxis, StageAxis] | None
    repeats: int


@dataclass(frozen=True)
class Result:
    """Friction of each axis by the values alone, scales of the controller's map, what acted in helices along and around (h,),
    quantities by name and where."""

    data: Data
    friction: Mapping[str, Friction]
    scales: Mapping[str, float]
    acted: tuple[Array, Array] | None
    radius: float | None
    estimates: dict[tuple[str, str], Estimate] = field(default_factory=dict)


def named(name: str, axis: StageAxis) -> str:
    """A quantity's name for an axis in m or rad."""
    return f"{name}_angle" if turns(axis) else name


def arrays(passes: Sequence[Pass], rig: RigFile, plan: Plan) -> Data:
    """Passes by axis, repeat and rate.

    Raises:
        AnalysisError: some are missing.
    """
    axes, of, by = {}, {}, {}
    for axis in chosen(rig, plan):
        by[axis.name], of[axis.name] = loads(rig, axis, plan), axis
        axes[axis.name] = _axis([p for p in passes if p.axis == axis.name and not p.turned], axis, by[axis.name], plan)
    pair = crossed(rig, plan)
    helix = None if pair is None else _helix([p for p in passes if p.turned], pair, plan)
    return Data(axes, of, by, helix, pair, plan.repeats)


def _one(some: Sequence[Pass], **wanted: object) -> Pass:
    found = those(some, **wanted)
    if len(found) != 1:
        said = ", ".join(f"{k} {v}" for k, v in wanted.items())
        raise AnalysisError(f"{said}: found {len(found)} passes; expected 1 (was the run stopped early?)")
    return found[0]


def _axis(some: Sequence[Pass], axis: StageAxis, by: Sequence[Source], plan: Plan) -> Axis:
    each = range(plan.repeats)
    free = {way: [[_one(some, axis=axis.name, load="", wanted=rate, way=way, repeat=k) for rate in rates(axis, plan)]
                  for k in each] for way in WAYS}  # fmt: skip
    under = {
        s.sign: np.array([np.mean([_one(some, axis=axis.name, load=s.name, way=way, repeat=k).force[axis.name]
                                   for way in WAYS]) for k in each])
        for s in by
    }  # fmt: skip
    rate = np.mean([[abs(p.rate[axis.name]) for p in row] for way in WAYS for row in free[way]], axis=0)
    plus, minus = (np.array([[p.force[axis.name] for p in row] for row in free[way]]) for way in WAYS)
    return Axis(rate, plus, minus, under.get(-1, np.empty(0)), under.get(1, np.empty(0)))


def _helix(some: Sequence[Pass], pair: tuple[StageAxis, StageAxis], plan: Plan) -> Helix:
    along, around = np.empty((2, plan.repeats, len(plan.helix_rad_s)))
    v, w = np.empty((2, plan.repeats, len(plan.helix_rad_s)))
    for k in range(plan.repeats):
        for j, rate in enumerate(plan.helix_rad_s):
            four = those(some, wanted=rate, repeat=k)
            if len(four) != 4:
                raise AnalysisError(f"helix at {rate:g} rad/s, repeat {k + 1}: found {len(four)} passes; expected 4 (was the "
                                    "run stopped early?)")  # fmt: skip
            along[k, j] = np.mean([p.way * p.force[pair[0].name] for p in four])
            around[k, j] = np.mean([p.turned * p.force[pair[1].name] for p in four])
            v[k, j] = np.mean([p.way * p.rate[pair[0].name] for p in four])
            w[k, j] = np.mean([p.turned * p.rate[pair[1].name] for p in four])
    return Helix(along, around, v.mean(axis=0), w.mean(axis=0))


def results(passes: Sequence[Pass], rig: RigFile, plan: Plan) -> Result:
    """Everything.

    Raises:
        AnalysisError: passes are missing.
    """
    data = arrays(passes, rig, plan)
    inputs = _inputs(data, rig, plan)
    sizes = _sizes(data, plan, {name: e.value for name, e in inputs.items()})
    whole = np.arange(data.repeats)
    told = _solved(data, sizes, whole)
    each = fit.pseudo([_vector(_solved(data, sizes, np.delete(whole, k))) for k in whole], _vector(told))
    shares = _by_certificates(data, plan, inputs)
    bends = _by_doubts(passes, rig, plan, sizes, _vector(told))
    out = {}
    for k, (name, where) in enumerate(_names(data)):
        value, unit = float(_vector(told)[k]), _unit(name, where, data)
        u = float(each[:, k].std(ddof=1)) / math.sqrt(data.repeats)
        who = f"{name}/{where}" if where else name
        scatter = Influence(f"scatter/{who}", "scatter of the repeats", u, unit, "A", "normal", data.repeats - 1.0)
        e = Estimate.of(value, scatter)
        if (name, where) in shares:
            e = e + (shares[name, where] - shares[name, where].value)
        for influence, moves in bends.items():
            e = e + Estimate(0.0, "", {influence: float(moves[k])})
        out[name, where] = Estimate(e.value, unit, e.sensitivities)
    return Result(data, told.friction, told.scales, told.acted, told.radius, out)


def _names(data: Data) -> list[tuple[str, str]]:
    names = [(named(n, data.of[axis]), axis) for axis in data.axes for n in (COULOMB, VISCOUS, BIAS)]
    return [*names, *([(RADIUS, "")] if data.helix is not None else [])]


def _unit(name: str, where: str, data: Data) -> str:
    if name == RADIUS:
        return "m"
    axis = data.of[where]
    return UNITS[name.removesuffix("_angle")][turns(axis)]


def _vector(r: Result) -> Array:
    parts = [x for f in r.friction.values() for x in (f.coulomb, f.viscous, f.bias)]
    return np.array([*parts, *([r.radius] if r.radius is not None else [])])


def _solved(data: Data, sizes: Mapping[str, tuple[float, float]], take: fit.Take) -> Result:
    found = {name: fit.friction(a, sizes[name], take) for name, a in data.axes.items()}
    scales = {name: fit.scale(a, sizes[name], found[name].bias, take) for name, a in data.axes.items()}
    if data.helix is None or data.pair is None:
        return Result(data, found, scales, None, None)
    one, other = (a.name for a in data.pair)
    acted = fit.helix_forces(data.helix, (scales[one], scales[other]), take)
    return Result(data, found, scales, acted, fit.radius_of(data.helix, acted, found[one], found[other]))


def _inputs(data: Data, rig: RigFile, plan: Plan) -> dict[str, Estimate]:
    """Certificates of the loads; of an axis without them, the tolerance of the controller's map, for each way of its own."""
    out: dict[str, Estimate] = {}
    for name, axis in data.of.items():
        if data.sources[name]:
            out |= load_inputs(rig, data.sources[name], (mass(axis, plan),))
            continue
        for way in ("up", "down"):
            out[f"map_{name}_{way}"] = Estimate.of(1.0, Influence(
                f"map/{name}/{way}", f"the controller's map, {name}, {way}", plan.map_share / math.sqrt(3), "1", "B",
                "rectangular", source="axis-friction: map_share of the plan"))  # fmt: skip
    return out


def _sizes(data: Data, plan: Plan, p: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Of each axis, what the load that pulls down and the one that pulls up pull with; where none does, what the map may be
    off each way."""
    out: dict[str, tuple[float, float]] = {}
    for name, axis in data.of.items():
        by = {s.sign: s for s in data.sources[name]}
        out[name] = (
            (-force(by[-1], mass(axis, plan), p), force(by[1], mass(axis, plan), p)) if by
            else (p[f"map_{name}_up"], p[f"map_{name}_down"])
        )  # fmt: skip
    return out


def _by_certificates(data: Data, plan: Plan, inputs: dict[str, Estimate]) -> dict[tuple[str, str], Estimate]:
    """What loads do to friction; a radius is that of a ratio, and has nothing of them."""
    names, whole = [n for n in _names(data) if n[0] != RADIUS], np.arange(data.repeats)
    axes = replace(data, helix=None)

    def model(p: dict[str, float]) -> dict[str, float]:
        values = _vector(_solved(axes, _sizes(data, plan, p), whole))
        return {"@".join(n): float(x) for n, x in zip(names, values, strict=True)}

    found = propagate(model, inputs)
    return {n: found["@".join(n)] for n in names}


def _by_doubts(
    passes: Sequence[Pass], rig: RigFile, plan: Plan, sizes: Mapping[str, tuple[float, float]], at: Array
) -> dict[Influence, Array]:
    """Sensitivities (q,) of the results to what bends the map: the currents of friction alone are smaller than under a load."""
    out: dict[Influence, Array] = {}
    for k, influence in enumerate(doubts(rig, plan.saturation_share)):
        if influence.u > 0:
            moved = [replace(p, force={a: f + influence.u * p.moves[a][k] for a, f in p.force.items()}) for p in passes]
            data = arrays(moved, rig, plan)
            out[influence] = (_vector(_solved(data, sizes, np.arange(data.repeats))) - at) / influence.u
    return out
