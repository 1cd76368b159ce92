"""Which axes go to and fro, how far, at which rates, under which loads and where the others stand meanwhile."""

from __future__ import annotations

import math
from collections.abc import Mapping

from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis, axes_of
from procedures.axis_friction.plan import Plan
from procedures.stages.known_loads import Source, sources
from procedures.stages.spread import middle, stands, turns

SPARE_S = 0.2
WAYS = (1, -1)
TURNED = (1, -1)


def chosen(rig: RigFile, plan: Plan) -> tuple[StageAxis, ...]:
    """The axes of the plan, in the rig's order."""
    return tuple(a for a in axes_of(rig).values() if not plan.axes or a.name in plan.axes)


def rates(axis: StageAxis, plan: Plan) -> tuple[float, ...]:
    """Of passes without a load."""
    return plan.rates_rad_s if turns(axis) else plan.rates_m_s


def load_rate(axis: StageAxis, plan: Plan) -> float:
    """Of passes under a load."""
    return plan.load_rate_rad_s if turns(axis) else plan.load_rate_m_s


def rise(axis: StageAxis, plan: Plan) -> float:
    """To a rate."""
    return plan.rise_rad_s2 if turns(axis) else plan.rise_m_s2


def settle(axis: StageAxis, plan: Plan) -> float:
    """Time at a rate before the window, s."""
    return plan.settle_rad_s if turns(axis) else plan.settle_m_s


def mass(axis: StageAxis, plan: Plan) -> str:
    """What hangs, by its label."""
    return plan.lever_mass if turns(axis) else plan.mass


def loads(rig: RigFile, axis: StageAxis, plan: Plan) -> tuple[Source, ...]:
    """One that pulls each way; none where the plan wants none, or where they pull one way alone."""
    if plan.scale != "loads":
        return ()
    found = sources(rig, axis)
    each = [next((s for s in found if s.sign == way), None) for way in WAYS]
    return tuple(s for s in each if s is not None) if None not in each else ()


def window(axis: StageAxis, plan: Plan) -> tuple[float, float]:
    """Between which readings forces are averaged: the same for every rate, way and load, so that what the place does to the
    controller's map is the same in all of them; whole turns."""
    if turns(axis):
        return 0.0, 2 * math.pi * plan.turns
    return middle(axis) - plan.window_m, middle(axis) + plan.window_m


def lead(axis: StageAxis, plan: Plan, rate: float, settle_s: float) -> float:
    """Way before the window: v^2/2a to the rate, and v t at it."""
    return rate * settle_s + rate**2 / (2 * rise(axis, plan))


def ends(axis: StageAxis, plan: Plan, rate: float, settle_s: float) -> tuple[float, float]:
    """Of a pass."""
    low, high = window(axis, plan)
    by = lead(axis, plan, rate, settle_s)
    return low - by, high + by


def start(axis: StageAxis, plan: Plan, repeat: int) -> float:
    """Where another axis stands in a repeat."""
    return stands(axis, repeat, plan.repeats, plan.window_m)


def crossed(rig: RigFile, plan: Plan) -> tuple[StageAxis, StageAxis] | None:
    """An axis along and one around that move at once; None where the plan or the rig has none."""
    axes = chosen(rig, plan)
    along, around = ([a for a in axes if turns(a) is way] for way in (False, True))
    return (along[0], around[0]) if plan.helix and along and around else None


def helix_settle(pair: tuple[StageAxis, StageAxis], plan: Plan) -> float:
    """s, of both."""
    return max(settle(a, plan) for a in pair)


def helix_turns(pair: tuple[StageAxis, StageAxis], plan: Plan, rate: float) -> float:
    """How far the one around goes while the one along makes its pass, rad."""
    low, high = ends(pair[0], plan, plan.helix_m_s, helix_settle(pair, plan))
    return rate * ((high - low) / plan.helix_m_s + plan.helix_m_s / rise(pair[0], plan) + SPARE_S)


def step_count(rig: RigFile, plan: Plan) -> int:
    """Passes."""
    count = sum(len(rates(a, plan)) + len(loads(rig, a, plan)) for a in chosen(rig, plan))
    if crossed(rig, plan) is not None:
        count += len(TURNED) * len(plan.helix_rad_s)
    return 2 * plan.repeats * count


def written(axis: StageAxis, plan: Plan, rate: float) -> Mapping[str, float]:
    """Parameters of a pass."""
    return {axis.rate: rate, **({axis.rise: rise(axis, plan)} if axis.rise else {})}
