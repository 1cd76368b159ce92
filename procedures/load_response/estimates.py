"""Compliance, friction and the force's scale of each axis, and how it answers loads, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis, term_of
from bench.uncertainty import Estimate, Influence, propagate
from procedures.load_response import fit
from procedures.load_response.fit import Array, Pairs, Slope
from procedures.load_response.plan import Plan
from procedures.load_response.sequence import Put, changes, chosen, count, lead, masses, order
from procedures.load_response.steps import Change, Rest
from procedures.shared.certificates import share_of
from procedures.stages.known_loads import force, load_inputs, rubbing, sources

Found = dict[tuple[str, str], Estimate]
COMPLIANCE, BAND, FRICTION, SCALE, PEAK, LEFT = (
    "compliance",
    "friction_band",
    "friction",
    "force_scale",
    "peak",
    "error_after",
)
MOVED = 0.2  # of the lead: an approach that went less far did not leave friction's other side


@dataclass(frozen=True)
class Static:
    """Of one axis: the loads in their order, `force` (J,) N or N m by the certificates, which of them are `used`, the pairs of
    approaches, the line of deviations and of forces given over the used loads; `moved` (J,), how far the shortest approach
    under each load went, of the lead; `rubbed`, by source N per N of load by which friction grows beyond what is stated, and
    its standard uncertainty; `by_mass`, compliances by each mass alone."""

    axis: StageAxis
    loads: tuple[Put, ...]
    force: Array
    used: Array
    pairs: Pairs
    deviation: Slope
    given: Slope
    moved: Array
    rubbed: Mapping[str, tuple[float, float]]
    by_mass: tuple[float, ...]


@dataclass(frozen=True)
class Answered:
    """Of one axis and load, put `on` or taken off: what is left at the end and the peak at every set point, both positive in
    the direction in which the axis is driven."""

    axis: StageAxis
    load: Put
    on: bool
    answers: fit.Answers

    @property
    def where(self) -> str:
        """As quantities name it."""
        assert self.load.source is not None
        return f"{self.axis.name}, {self.load.source.name}" + ("" if self.on else ", off")


@dataclass(frozen=True)
class Result:
    """All axes; quantities by name and where, those of axes in rad with `_angle` or as torque."""

    statics: Sequence[Static] = ()
    answered: Sequence[Answered] = ()
    estimates: Found = field(default_factory=dict)


def results(rests: Sequence[Rest], found: Sequence[Change], rig: RigFile, plan: Plan) -> Result:
    """All of it.

    Raises:
        AnalysisError: steps that are missing.
    """
    statics, answered, out = [], [], {}
    for axis in chosen(rig, plan):
        if plan.static:
            one = static(axis, [r for r in rests if r.axis == axis.name], rig, plan)
            statics.append(one)
            out.update(_of_static(one, rig, plan))
        if plan.disturbed:
            some = answers(axis, [c for c in found if c.axis == axis.name], rig, plan)
            answered += some
            out.update(_of_answers(some, plan))
    return Result(tuple(statics), tuple(answered), out)


def static(axis: StageAxis, rests: Sequence[Rest], rig: RigFile, plan: Plan) -> Static:
    """Approaches as arrays, and their lines."""
    loads = order(rig, axis, plan)
    if len(rests) != 2 * plan.phases * len(loads):
        raise AnalysisError(f"axis {axis.name}: found {len(rests)} approaches; expected {2 * plan.phases * len(loads)} (was "
                            "the run stopped early?)")  # fmt: skip
    table = np.array([(r.deviation, r.given, r.side * r.moved) for r in rests])
    up, down = table.reshape(plan.phases, len(loads), 2, 3).transpose(2, 1, 0, 3)
    pairs = Pairs((up + down)[..., 0] / 2, (down - up)[..., 0] / 2, (up + down)[..., 1] / 2)
    p = {name: e.value for name, e in inputs(axis, rig, plan).items()}
    forces, rubs = _forces(loads, p), np.array([_rubs(load, p) for load in loads])
    used = beyond_friction(forces, pairs)
    lined = (
        used if used[forces != 0].any() else np.ones_like(used)
    )  # a line of loads that all stick is drawn, and no more
    line, given = fit.slope(forces[lined], pairs.mean[lined]), fit.slope(forces[lined], pairs.given[lined])
    moved = np.minimum(up[..., 2], down[..., 2]).min(axis=1) / lead(axis, plan)
    mass = np.array([-1 if not q.label else masses(axis, plan).index(q.label) for q in loads])
    growth = _growth(loads, forces, pairs.half / abs(line.value), rubs)
    by_mass = tuple(fit.pairwise(forces[used], pairs.mean[used], mass[used]))
    return Static(axis, loads, forces, used, pairs, line, given, moved, growth, by_mass)


def beyond_friction(forces: Array, pairs: Pairs) -> Array:
    """Loads that move the axis by more than friction holds it, and none: what friction may hold tells no compliance."""
    none = forces == 0
    shift = np.abs(pairs.mean.mean(axis=1) - pairs.mean[none].mean())
    used: Array = none | (shift > pairs.half.mean())
    return used


def _growth(loads: Sequence[Put], force: Array, held: Array, rubs: Array) -> dict[str, tuple[float, float]]:
    """By source, of friction under its loads less that under none: its share of the loads beyond what is stated of its pulley,
    and the standard uncertainty of that."""
    each, _ = fit.uneven(held)
    out = {}
    for source in dict.fromkeys(q.source for q in loads if q.source is not None):
        rows = np.array([q.source == source for q in loads])
        more = held[rows].mean(axis=1) - rubs[rows] - held[force == 0].mean()
        u = each * math.sqrt(1 / rows.sum() + 1 / (force == 0).sum())
        weight = float(np.abs(force[rows]).mean())
        out[source.name] = float(more.mean()) / weight, u / weight
    return out


def inputs(axis: StageAxis, rig: RigFile, plan: Plan) -> dict[str, Estimate]:
    """What forces are made of."""
    return load_inputs(rig, sources(rig, axis), masses(axis, plan))


def _forces(loads: Sequence[Put], p: Mapping[str, float]) -> Array:
    return np.array([0.0 if q.source is None else force(q.source, q.label, p) for q in loads])


def _rubs(load: Put, p: Mapping[str, float]) -> float:
    return 0.0 if load.source is None else rubbing(load.source, load.label, p)


def _of_static(s: Static, rig: RigFile, plan: Plan) -> Found:
    """Compliance, friction and the scale of the force that the controller gives; nothing without loads beyond friction both
    ways, or where approaches did not move the axis."""
    if not both_ways(s) or s.moved.min() < MOVED:
        return {}
    loads, used, turns = s.loads, s.used, s.axis.unit == "rad"

    def model(p: dict[str, float]) -> dict[str, float]:
        forces = _forces(loads, p)[used]
        per, _ = fit.line(forces, s.pairs.mean[used])
        scale, _ = fit.line(forces, s.pairs.given[used])
        return {COMPLIANCE: per, SCALE: -1 / scale, "rubs": float(np.mean([_rubs(q, p) for q in loads]))}

    known = propagate(model, inputs(s.axis, rig, plan))
    by_points = Estimate.of(1.0, Influence(f"scatter/{s.axis.name}/slope", "scatter of the set points", s.deviation.u
                                           / abs(s.deviation.value), "1", "A", "normal", s.deviation.dof))  # fmt: skip
    encoder = _encoder(s, rig)
    compliance = known[COMPLIANCE] * by_points * encoder
    band = _band(s) * encoder
    held = band / compliance * _bent(s) - known["rubs"]
    units = ("rad/(N m)", "rad", "N m") if turns else ("m/N", "m", "N")
    made = {COMPLIANCE: (compliance, units[0]), BAND: (band, units[1]), FRICTION: (held, units[2]),
            SCALE: (known[SCALE] / by_points, "1")}  # fmt: skip
    return {(named(name, turns), s.axis.name): _in(e, unit) for name, (e, unit) in made.items()}


def both_ways(s: Static) -> bool:
    """Whether loads beyond friction pull both ways."""
    return bool((s.force[s.used] > 0).any() and (s.force[s.used] < 0).any())


def named(name: str, turns: bool) -> str:
    """A quantity's name for an axis in m or rad."""
    if not turns or name == SCALE:
        return name
    return "friction_torque" if name == FRICTION else f"{name}_angle"


def _in(e: Estimate, unit: str) -> Estimate:
    return Estimate(e.value, unit, e.sensitivities, e.sampler)


def _band(s: Static) -> Estimate:
    """Half of the difference, and half a count that a slow axis stops short of it."""
    name, unit = s.axis.name, s.axis.unit
    u, dof = fit.uneven(s.pairs.half)
    by_points = Influence(
        f"scatter/{name}/band", "scatter of the set points", u / math.sqrt(dof), unit, "A", "normal", dof
    )
    return Estimate.of(float(s.pairs.half.mean()) + count(s.axis) / 2, by_points)


def _bent(s: Static) -> Estimate:
    """The force's scale where friction holds, beside that of the line: what slopes between neighbouring loads differ by."""
    u = fit.bends(s.force[s.used], s.pairs.mean[s.used])
    name = "scale of the force between the loads"
    return Estimate.of(
        1.0, Influence(f"bends/{s.axis.name}", name, u, "1", "B", "normal", source="slopes between neighbours")
    )


def _encoder(s: Static, rig: RigFile) -> Estimate:
    """What a length is by the encoder's scale, and by an error that goes once a turn, or over twice the way along."""
    out, name = Estimate.exact(1.0, "1"), s.axis.name
    encoder = rig.encoders[name]
    if encoder.pitch is not None and s.axis.pitch is not None and s.axis.pitch.standard_uncertainty > 0:
        term = term_of(rig, encoder.pitch, name, "pitch")
        out = out * share_of(term.identity, term.number, f"scale of encoder {name}")
    if encoder.error is not None and s.axis.error is not None:
        term = term_of(rig, encoder.error, name, "error")
        wide = math.sqrt(3) * term.number.standard_uncertainty
        way = 1.0 if s.axis.unit == "rad" else float(np.ptp(s.pairs.mean)) / 2
        slope = Influence(f"{term.identity}/slope", f"error of encoder {name}, its slope", wide / way / 2, "1", "B", "normal",
                          source=term.number.source)  # fmt: skip
        out = out * Estimate.of(1.0, slope)
    return out


def answers(axis: StageAxis, found: Sequence[Change], rig: RigFile, plan: Plan) -> list[Answered]:
    """Of every load put on and taken off."""
    out = []
    for load in changes(rig, axis, plan):
        assert load.source is not None
        for on in (True, False):
            some = [c for c in found if (c.source, c.load, c.on) == (load.source.name, load.label, on)]
            if len(some) != plan.phases:
                raise AnalysisError(f"axis {axis.name}, {load.name}: found {len(some)} changes; expected {plan.phases} (was "
                                    "the run stopped early?)")  # fmt: skip
            sign = load.source.sign if on else -load.source.sign
            rows = [fit.answer(c.times, sign * c.deviation, plan.after_s, plan.look_s) for c in some]
            out.append(Answered(axis, load, on, fit.Answers(*np.array(rows).T)))
    return out


def _of_answers(some: Sequence[Answered], plan: Plan) -> Found:
    """Means over the set points, which scatter alike under all loads of an axis, on and off. A loop that acts on counts turns
    an axis back just beyond the edge of one: it has gone less far than it reads, by none to half a count. What is left at the
    end lies anywhere in its count."""
    out: Found = {}
    for name, key in ((PEAK, "peak"), (LEFT, "left")):
        rows = np.array([getattr(a.answers, key) for a in some])
        s, dof = fit.scatter(rows)
        for a, row in zip(some, rows, strict=True):
            u, unit, quarter = s / math.sqrt(len(row)), a.axis.unit, count(a.axis) / 4
            less, width = (quarter, quarter) if name == PEAK else (0.0, 2 * quarter / plan.phases)
            points = Influence(f"scatter/{name}/{a.where}", "scatter of the set points", u, unit, "A", "normal", dof)
            e = Estimate.of(float(row.mean()) - less, points)
            if width:
                rounded = Influence(
                    f"rounding/{name}/{a.where}", "counts", width / math.sqrt(3), unit, "B", "rectangular"
                )
                e = e + Estimate.of(0.0, rounded)
            out[named(name, a.axis.unit == "rad"), a.where] = e
    return out
