"""What the rig's controller holds, and what its numbers say of a shot: how far it goes and whether it is caught."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_loops import HeldAxis, Hold
from bench.rigfile.places import Places
from procedures.shared.rates import rate_of
from procedures.unstable_pole.plan import Plan

USUAL_HZ = 35e3
SPARE = 0.8  # of what the bearings catch: their currents take a tenth of a growth to come


def ability(rig: RigFile) -> Hold:
    """What the controller holds.

    Raises:
        Lacking: nothing.
    """
    can = rig.capabilities.hold
    if can is None:
        raise Lacking("capabilities.hold: found none")
    return can


def chosen(rig: RigFile, plan: Plan) -> tuple[str, ...]:
    """The axes of the plan, or all."""
    return plan.axes or tuple(ability(rig).axes)


def rate(rig: RigFile) -> float:
    """Of captures, Hz."""
    return rate_of(rig, None, USUAL_HZ)


def captured(rig: RigFile) -> tuple[str, ...]:
    """Positions and currents of all axes, whichever is pushed, and whether they are held."""
    can = ability(rig)
    positions = [c for axis in can.axes.values() for c in axis.positions]
    return (*positions, *currents(rig), can.held)


def currents(rig: RigFile) -> tuple[str, ...]:
    """All that are held."""
    return tuple(c for axis in ability(rig).axes.values() for c in axis.currents)


def place(rig: RigFile, plan: Plan) -> float | None:
    """Set point along the shaft; None: there is none, or it stays."""
    middle = ability(rig).middle
    if rig.capabilities.motion is None:
        return None
    return plan.place_m if plan.place_m is not None else None if middle is None else middle.value


@dataclass(frozen=True)
class Foreseen:
    """By the rig file's numbers, of one axis: `pole` 1/s; how far the push alone goes in the time of a hold, `travel` m; what
    the bearings would have to catch then, place and rate over the pole, `to_catch` m, and at the bound, `at_bound` m; how far
    they reach, `reach` m."""

    pole: float
    travel: float
    to_catch: float
    at_bound: float
    reach: float


def foreseen(rig: RigFile, plan: Plan, axis: HeldAxis) -> Foreseen:
    """From rest x = a (cosh lambda t - 1) with a = 2 K_B i/(K_1 + K_2); x + x'/lambda = a (e^(lambda t) - 1), which at a bound
    b is less than 2 b + a. A force F catches what has less than F/K of it; zeros of the probes take their part."""
    can, known = ability(rig), Places(rig).known
    stiff = [known[name].value for name in axis.stiffness]
    pole = math.sqrt(sum(stiff) / known[can.mass].value)
    a = 2 * can.force.value * plan.push_A / sum(stiff)
    grown = pole * plan.hold_s
    zeros = [rig.sensors[c].offset for c in axis.positions if c in rig.sensors]
    off = max((abs(t.value) + math.sqrt(3) * t.standard_uncertainty for t in zeros), default=0.0)
    most = max(known[name].value + math.sqrt(3) * known[name].standard_uncertainty for name in axis.stiffness)
    reach = rig.parameters[can.limit].default / most - off
    return Foreseen(pole, a * (math.cosh(grown) - 1), a * math.expm1(grown), 2 * plan.bound_m + a, reach)
