"""Which axes are ramped to and fro, under which loads and where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis, axes_of
from procedures.axis_breakaway.plan import Plan
from procedures.stages.known_loads import Source, sources
from procedures.stages.spread import others, stands, turns

WAYS = (1, -1)
PULLS = (-1, 0, 1)  # of the axis around, beside an axis along that is ramped
BACK = 0.25  # of the span, by which a set point goes back after a slide, so that its axis is held by about nothing
ON = 0.2  # of the span, by which a ramp goes on where a slide ended
INTEGRATORS = "integrators"
RADIUS = "bearing_radius"
HELIX_PART = 0.6  # of the span around, that a helix is ramped by


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


def seen(axis: StageAxis) -> float:
    """What its reading is to go before it is seen to move: a count, m or rad."""
    return axis.pitch.value if axis.pitch is not None else 0.0


def place(axis: StageAxis, plan: Plan, repeat: int) -> float:
    """The middle of a ramp: somewhere else in every repeat, and within a count."""
    return stands(axis, repeat, plan.repeats, plan.spread_m)


def beside(rig: RigFile, plan: Plan, axis: StageAxis) -> StageAxis | None:
    """The axis around that is pulled while one along is ramped; None beside an axis around, or where the rig has none.

    A force beside a torque takes nothing worth a correction off it: the loop along rests within some counts, below a tenth of
    its friction, and what goes by the square of that is below half a per cent."""
    if turns(axis) or plan.pull_rad == 0:
        return None
    return next((a for a in others(rig, axis) if turns(a)), None)


def pair(rig: RigFile, plan: Plan) -> tuple[StageAxis, StageAxis] | None:
    """An axis along and one around that are ramped at once; None where the plan or the rig has none, or its balls roll at no
    radius that is known."""
    axes = chosen(rig, plan)
    along, around = ([a for a in axes if turns(a) is way] for way in (False, True))
    return (along[0], around[0]) if plan.helix and along and around and RADIUS in rig.geometry else None


@dataclass(frozen=True)
class Helix:
    """Rates and ways of both axes, by axis, m or rad: of the slide before, so that both are held as the helix pulls them, and
    of the ramp, which takes force and torque through nothing to the same on the other side."""

    slide: Mapping[str, float]
    slid: Mapping[str, float]
    ramp: Mapping[str, float]
    ramped: Mapping[str, float]


def helix(rig: RigFile, plan: Plan, both: tuple[StageAxis, StageAxis], share: float) -> Helix:
    """Force along is to be `share` times the torque, each of what one friction along the path at the bearing's radius has: it
    goes with the surface's velocity."""
    along, around = both
    radius = rig.geometry[RADIUS].value
    stiffness = [rig.parameters[a.stiffness].default for a in both]
    less = min(1.0, 1 / share)
    slide_s, ramp_s = plan.span_rad / plan.slide_rad_s, HELIX_PART * plan.span_rad / plan.ramp_rad_s
    slide = {along.name: share * less * radius * plan.slide_rad_s, around.name: less * plan.slide_rad_s}
    creep = less * plan.ramp_rad_s
    ramp = {along.name: share * creep * stiffness[1] / (stiffness[0] * radius), around.name: creep}
    return Helix(slide, {n: v * slide_s for n, v in slide.items()}, ramp, {n: v * ramp_s for n, v in ramp.items()})


def step_count(rig: RigFile, plan: Plan) -> int:
    """Ramps."""
    count = sum(
        (1 + len(loads(rig, a))) * (1 if beside(rig, plan, a) is None else len(PULLS)) for a in chosen(rig, plan)
    )
    return 2 * plan.repeats * (count + (2 * len(plan.helix) if pair(rig, plan) is not None else 0))
