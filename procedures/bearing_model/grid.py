"""Where the shaft is held: a grid of places within the rings, and the tilts before it."""

from __future__ import annotations

import itertools
import math

from bench.rigfile import RigFile
from bench.rigfile.protection import of_channels
from procedures.amb_rotor import rings
from procedures.amb_rotor.conventions import conventions
from procedures.bearing_model.plan import Plan

MARGIN = 5e-6  # of the radius: noise, and what the controller swings on the way
USED, QUARTER = 0.9, 4  # of the room that is there; spacings in a radius


def grid(radius_m: float, spacing_m: float) -> list[tuple[float, float]]:
    """Positions (y, z) within the circle, row by row to and fro, so that every move is a short one."""
    n = math.floor(radius_m / spacing_m + 1e-9)
    levels = [round(k * spacing_m, 9) for k in range(-n, n + 1)]
    rows = []
    for k, z in enumerate(levels):
        row = [(y, z) for y in levels if math.hypot(y, z) <= radius_m * (1 + 1e-9)]
        rows.append(row if k % 2 == 0 else row[::-1])
    return list(itertools.chain.from_iterable(rows))


def places(rig: RigFile, plan: Plan) -> list[tuple[float, float]]:
    """The grid of a plan on a rig."""
    radius = plan.radius_m or most(rig)
    return grid(radius, (plan.spacing_m if plan.radius_m else None) or radius / QUARTER)


def biases(rig: RigFile, plan: Plan) -> tuple[float, ...]:
    """Of each pass, A: the plan's; else one pass with that of the controller, as it is set, no number where it has none or
    its bearings have different ones."""
    alike = {rig.parameters[name].default for name in conventions(rig).biases.values()}
    return plan.biases_A or ((alike.pop(),) if len(alike) == 1 else (math.nan,))


def bias_by_axis(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Of the first pass, A, of each axis whose bearing has a bias: a plan sets all alike, a controller has its own of each."""
    return {axis: plan.biases_A[0] if plan.biases_A else rig.parameters[name].default
            for axis, name in conventions(rig).biases.items()}  # fmt: skip


def find_room(rig: RigFile) -> float:
    """What ring, zeros, runout and protection leave of the radius, m."""
    return min(rings.room(rig), protected(rig)) - MARGIN


def protected(rig: RigFile) -> float:
    """How far from zero the nearest limit of a radial probe is while the shaft is held, m; infinite where there is none."""
    probes = conventions(rig).stations.probes
    return min((min(p.high, -p.low) for p in of_channels(rig) if p.name in probes), default=math.inf)


def most(rig: RigFile) -> float:
    """Of the radius, m, by ring, protection and set points: to whole micrometres."""
    machine = conventions(rig)
    highs = [reach(rig, name) / abs(value) for c in "yz" for name, value in machine.point(c, 1.0).items()]
    return math.floor(USED * min(find_room(rig), *highs) * 1e6) * 1e-6


def reach(rig: RigFile, parameter: str) -> float:
    """How far a set point goes to either side, m or rad."""
    return min(rig.parameters[parameter].high, -rig.parameters[parameter].low)


def tilts(plan: Plan) -> list[tuple[float, float]]:
    """(psi, theta) of the check of the wiring."""
    t = plan.tilt_rad
    return [(0.0, 0.0), (t, 0.0), (-t, 0.0), (0.0, t), (0.0, -t)]


def count_places(plan: Plan) -> int:
    """How many places a plan has, on any rig."""
    if plan.radius_m is None:
        return len(grid(float(QUARTER), 1.0))
    return len(grid(plan.radius_m, plan.spacing_m or plan.radius_m / QUARTER))
