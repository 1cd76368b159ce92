"""What the gate has to spare at each place, and the catch of each bearing and axis, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from bench.rigfile.places import Places
from bench.uncertainty import Estimate, Influence
from procedures.gate_margin import fit
from procedures.gate_margin.place import Plane, planes, samples
from procedures.gate_margin.plan import Plan
from procedures.gate_margin.steps import Array, Taken
from procedures.position_loops.movers import radial
from procedures.shared.certificates import certified

NEAR = 0.2  # of an excursion: a plane is taken to have half of the mass
GATE, CATCH = "gate_margin", "catch_margin"


@dataclass(frozen=True)
class Looked:
    """A place: the largest |reading| of each window (w,) m, what normal noise of the same size would make of their mean."""

    taken: Taken
    largest: Array
    normal: float


@dataclass(frozen=True)
class Caught:
    """A bearing and axis: by place what its force holds from where the shaft rests, `reach` m, and how far that went from
    there, `excursion` m."""

    plane: Plane
    reach: Array
    excursion: Array


@dataclass(frozen=True)
class Results:
    """All of it; estimates by quantity and where."""

    gate_m: float
    gate_s: float
    looked: Sequence[Looked]
    caught: Sequence[Caught]
    estimates: Mapping[tuple[str, str], Estimate]


def results(
    taken: Sequence[Taken], gate: tuple[float, float], rig: RigFile, plan: Plan, poles: Mapping[str, Estimate] | None
) -> Results:
    """Both margins; `poles`, 1/s, as they were measured, by `pole@` and the axis."""
    looked = [_looked(t, gate[1]) for t in taken]
    out = _gate_margins(looked, gate[0])
    caught = []
    for plane in planes(rig):
        found, estimate = _caught(plane, taken, gate[1], rig, plan, poles)
        caught.append(found)
        out[CATCH, plane.probe] = estimate
    return Results(*gate, looked, caught, out)


def _looked(t: Taken, gate_s: float) -> Looked:
    n = samples(gate_s, 1 / t.step_s)
    expected = fit.normal_largest(t.readings.mean(axis=0), t.readings.std(axis=0), n)
    return Looked(t, fit.largest(t.readings, n), expected)


def _gate_margins(looked: Sequence[Looked], gate_m: float) -> dict[tuple[str, str], Estimate]:
    """The mean over windows, with the scatter of windows about the mean of their place, all places together: a largest reading
    is a count of the converter, and ten of one place may well be the same one."""
    left = sum(float(((x.largest - x.largest.mean()) ** 2).sum()) for x in looked)
    dof = sum(len(x.largest) - 1 for x in looked)
    s = math.sqrt(left / dof)
    out = {}
    for x in looked:
        scatter = Influence(f"scatter/{GATE}/{x.taken.place.name}", "scatter of the windows", s / math.sqrt(len(x.largest)),
                            "m", "A", "normal", float(dof), source="windows of all places")  # fmt: skip
        out[GATE, x.taken.place.name] = Estimate.of(gate_m - float(x.largest.mean()), scatter)
    return out


def stiffness(plane: Plane, rig: RigFile, poles: Mapping[str, Estimate] | None) -> Estimate:
    """K of a plane: stated, or of lambda^2 m = K_1 + K_2 its half, and half of what the stated ones differ by."""
    known, can = Places(rig).known, rig.capabilities.hold
    assert can is not None
    both = {name: certified(name, known[name]) for name in plane.both}
    stated = both[plane.stiffness]
    if poles is None or (pole := poles.get(f"pole@{plane.axis}")) is None:
        return stated
    together: Estimate = pole * pole * certified(can.mass, known[can.mass])
    other = next((both[name] for name in plane.both if name != plane.stiffness), stated)
    return (together + stated - other) / 2


def rate_of_leaving(plane: Plane, rig: RigFile, poles: Mapping[str, Estimate] | None) -> float:
    """lambda, 1/s."""
    known, can = Places(rig).known, rig.capabilities.hold
    assert can is not None
    if poles is not None and f"pole@{plane.axis}" in poles:
        return poles[f"pole@{plane.axis}"].value
    return math.sqrt(sum(known[name].value for name in plane.both) / known[can.mass].value)


def _caught(
    plane: Plane, taken: Sequence[Taken], gate_s: float, rig: RigFile, plan: Plan, poles: Mapping[str, Estimate] | None
) -> tuple[Caught, Estimate]:
    """The least of all places: (K_B/K)(i_limit - |i_rest|) - excursion. At rest the current says how far the shaft stands from
    where the magnets' pull is nothing, wherever its probe has its zero."""
    can = rig.capabilities.hold
    assert can is not None
    told = can.force.value  # N/A that the controller reckons with
    per_ampere = certified(f"capabilities/hold/force/{plane.stiffness}", can.force, "force of a bearing's current")
    ratio = per_ampere / stiffness(plane, rig, poles)
    pole, limit = rate_of_leaving(plane, rig, poles), rig.parameters[can.limit].default / told
    weight, mass = weight_of(plane, rig), Places(rig).known[can.mass].value
    spare, far, u = [], [], []
    for t in taken:
        n = samples(gate_s, 1 / t.step_s)
        means = fit.cut(t.currents[plane.current], n).mean(axis=1)
        spare.append(limit - abs(float(means.mean()) - weight))
        u.append(float(means.std(ddof=1)) / math.sqrt(len(means)))
        k = list(radial(rig).values()).index(plane.channel)
        current = t.currents[plane.current]
        gone = fit.excursions(t.readings[:, k], current, n, t.step_s, plan.smooth_s, pole, 2 * told / mass)
        far.append(float(gone.mean()))
    reach, excursion = np.array(spare) * ratio.value, np.array(far)
    k = int(np.argmin(reach - excursion))
    scatter = Influence(f"scatter/{CATCH}/{plane.probe}", "scatter of the current at rest", u[k], "A", "A", "normal",
                        float(plan.windows - 1), source="windows")  # fmt: skip
    left = Influence(f"excursion/{plane.probe}", "noise in how far the shaft goes at rest",
                     NEAR * excursion[k] / math.sqrt(3), "m", "B", "rectangular",
                     source="docs/reference/gate-margin.md")  # fmt: skip
    room = Estimate.of(spare[k], scatter)
    return Caught(plane, reach, excursion), room * ratio - Estimate.of(excursion[k], left)


def weight_of(plane: Plane, rig: RigFile) -> float:
    """The current by which the controller carries the weight beside its limit, A: by the mass that it knows, or that is stated
    where the rig file does not bind it."""
    can, known = rig.capabilities.hold, Places(rig).known
    assert can is not None
    name = rig.capabilities.model.get("mass", "")
    mass = rig.parameters[name].default if name in rig.parameters else known[can.mass].value
    return plane.carried * mass * rig.site.gravity.value / can.force.value
