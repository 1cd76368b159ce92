"""Which axes are ramped to and fro, under which loads and where."""

from __future__ import annotations

from collections.abc import Mapping

from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis, axes_of
from procedures.axis_breakaway.plan import Plan
from procedures.stages.known_loads import Source, sources
from procedures.stages.spread import stands, turns

WAYS = (1, -1)
INTEGRATORS = "integrators"


def chosen(rig: RigFile, plan: Plan) -> tuple[StageAxis, ...]:
    """The axes of the plan, in the rig's order."""
    return tuple(a for a in axes_of(rig).values() if not plan.axes or a.name in plan.axes)


def mass(axis: StageAxis, plan: Plan) -> str:
    """What hangs, by its label."""
    return plan.lever_mass if turns(axis) else plan.mass


def loads(rig: RigFile, axis: StageAxis) -> tuple[Source, ...]:
    """One that pulls each way; none where they pull one way alone."""
    each = [next((s for s in sources(rig, axis) if s.sign == way), None) for way in WAYS]
    return tuple(s for s in each if s is not None) if None not in each else ()


def ramp(axis: StageAxis, plan: Plan) -> tuple[float, float]:
    """Rate and span of its set point."""
    return (plan.ramp_rad_s, plan.span_rad) if turns(axis) else (plan.ramp_m_s, plan.span_m)


def place(axis: StageAxis, plan: Plan, repeat: int) -> float:
    """The middle of a ramp: somewhere else in every repeat, and within a count."""
    return stands(axis, repeat, plan.repeats, plan.spread_m)


def pair(rig: RigFile, plan: Plan) -> tuple[StageAxis, StageAxis] | None:
    """An axis along and one around that are ramped at once; None where the plan or the rig has none."""
    axes = chosen(rig, plan)
    along, around = ([a for a in axes if turns(a) is way] for way in (False, True))
    return (along[0], around[0]) if plan.helix and along and around else None


def rates(both: tuple[StageAxis, StageAxis], plan: Plan, share: float) -> tuple[dict[str, float], dict[str, float]]:
    """Rates and spans of both axes of a helix, by axis: the one whose share is greater goes by the plan's rate. Each alone
    needs its own span to break away; shares are of these."""
    along, around = both
    factor = {along.name: min(share, 1.0), around.name: min(1 / share, 1.0)}
    each = {a.name: ramp(a, plan) for a in both}
    seconds = max(span / rate for rate, span in each.values())
    spans = {name: span * factor[name] for name, (_, span) in each.items()}
    return {name: span / seconds for name, span in spans.items()}, spans


def written(axis: StageAxis, rate: float) -> Mapping[str, float]:
    """Parameters of a ramp."""
    return {axis.rate: rate}


def step_count(rig: RigFile, plan: Plan) -> int:
    """Ramps."""
    count = sum(1 + len(loads(rig, a)) for a in chosen(rig, plan))
    return 2 * plan.repeats * (count + (2 * len(plan.helix) if pair(rig, plan) is not None else 0))
