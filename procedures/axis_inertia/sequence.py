"""Which axes play which sines, with which parts on the shaft."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis, axes_of
from procedures.axis_inertia.plan import Part, Plan, Tones
from procedures.stages.spread import stands, turns
from procedures.stages.stators import POLES

PARTS: Mapping[str, tuple[str, str]] = {
    "ring": ("ring_mass", "ring_inertia"), "bar": ("added_mass", "added_mass_inertia"),
}  # fmt: skip
"""Of each part that can be put on a shaft, its mass and its moment of inertia among the numbers of the machine."""
BARE = ""


@dataclass(frozen=True)
class Tone:
    """A sine of an axis: its number in the plan, amplitude m or rad, Hz."""

    number: int
    amplitude: float
    hz: float


def plays(axis: StageAxis) -> bool:
    """Whether an axis plays sines of which force is told."""
    w = axis.wave
    return (
        w is not None and w.sine is not None and bool(w.amplitude) and bool(w.period) and bool(axis.given or axis.asked)
    )


def chosen(rig: RigFile, plan: Plan) -> tuple[StageAxis, ...]:
    """The axes of the plan, in the rig's order."""
    return tuple(a for a in axes_of(rig).values() if plays(a) and (not plan.axes or a.name in plan.axes))


def tones(axis: StageAxis, plan: Plan, on: str = BARE) -> tuple[Tone, ...]:
    """Of an axis with a part `on`: as great as without it, and so much slower that they ask for little more force. So currents
    are about as great, and what makes a newton of great ones another share of the map's all but falls out with the map."""
    around = turns(axis)
    some: Tones = plan.tones_rad if around else plan.tones_m
    share = (plan.slower_rad if around else plan.slower_m) if on else 1.0
    return tuple(Tone(k, amplitude, share * hz) for k, (amplitude, hz) in enumerate(some))


def part(axis: StageAxis, plan: Plan) -> Part:
    """What is added for an axis."""
    return plan.part_rad if turns(axis) else plan.part_m


def known(axis: StageAxis, plan: Plan) -> str:
    """Of that part, the number of the machine that counts for the axis."""
    return PARTS[part(axis, plan)][turns(axis)]


def among_phases(rig: RigFile, axis: StageAxis, plan: Plan) -> tuple[float, ...]:
    """By repeat, where an axis around stands between two phases of its motor, as an angle of 2 pi from one to the next: the
    rotor's poles by the phases of a stator are their number in a turn. 0 along, or where the rig file does not have them."""
    poles = rig.machine.get(POLES)
    if poles is None or not turns(axis):
        return (0.0,) * plan.repeats
    each = poles.value * max((len(m.currents) for m in rig.motors.values()), default=0)
    return tuple(math.remainder(each * stands(axis, k, plan.repeats, 0.0), 2 * math.pi) for k in range(plan.repeats))


def order(rig: RigFile, plan: Plan) -> Iterator[tuple[str, tuple[StageAxis, ...]]]:
    """Parts, the bare shaft first, with the axes that play with each."""
    axes = chosen(rig, plan)
    yield BARE, axes
    for name in PARTS:
        if mine := tuple(a for a in axes if part(a, plan) == name):
            yield name, mine


def step_count(rig: RigFile, plan: Plan) -> int:
    """Sines."""
    return 2 * plan.repeats * sum(len(tones(a, plan)) for a in chosen(rig, plan))
