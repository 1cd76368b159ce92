"""Vectors of what turns with the shaft, by plane and place, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from bench.rigfile.places import Places
from bench.uncertainty import Estimate, Influence
from procedures.position_loops.motors import electrical_turn
from procedures.runout_map import fit
from procedures.runout_map.plan import Plan
from procedures.runout_map.planes import Plane, planes
from procedures.runout_map.steps import Turned
from procedures.shared.certificates import certified, certified_gain

Found = dict[tuple[str, str], Estimate]
PARTS = ("x", "y")


@dataclass(frozen=True)
class Seen:
    """A plane at a place: of each turn the vectors of `current` A, `reading` m and of both together, `whole` m, that go with
    the shaft, and of that together what goes the `other` way; and the place's name."""

    plane: Plane
    place: str
    signs: tuple[int, ...]
    current: tuple[complex, ...]
    reading: tuple[complex, ...]
    whole: tuple[complex, ...]
    other: tuple[complex, ...]


@dataclass(frozen=True)
class Results:
    """All planes at all places; standard uncertainty of either part of a mean vector by the scatter of turns, of current A and
    of both together m, with its degrees of freedom; quantities by name and place."""

    seen: tuple[Seen, ...]
    u_current: float
    u_whole: float
    dof: int
    estimates: Found


def ratio(rig: RigFile, plane: Plane) -> Estimate:
    """Force per ampere over negative stiffness, m/A, of the rig file; a read ampere is its sensors' gain less."""
    can = rig.capabilities.hold
    assert can is not None
    force = certified("capabilities/hold/force", can.force, "force of a bearing per ampere")
    return force / certified(plane.stiffness, Places(rig).known[plane.stiffness]) / gain(rig, plane)


def gain(rig: RigFile, plane: Plane) -> Estimate:
    """Mean of the sensors' that read its coils."""
    coils = rig.motors[plane.motor].currents if plane.motor else ()
    if not coils:
        return Estimate.exact(1.0, "1")
    return sum((certified_gain(rig, c) for c in coils), Estimate.exact(0.0, "1")) * (1 / len(coils))


def results(turned: Sequence[Turned], rig: RigFile, plan: Plan) -> Results:
    """Of all turns."""
    seen = []
    for place in dict.fromkeys(t.place for t in turned):
        some = [t for t in turned if t.place == place]
        seen += [_seen(rig, plane, f"{place * 1e3:.4g} mm", some) for plane in planes(rig)]
    u_current, _ = _scatter([(s.signs, s.current) for s in seen])
    u_whole, dof = _scatter([(s.signs, s.whole) for s in seen])
    out: Found = {}
    for s in seen:
        out |= _estimates(s, rig, plan, u_current, u_whole, dof)
    return Results(tuple(seen), u_current, u_whole, dof, out)


def _seen(rig: RigFile, plane: Plane, place: str, turned: Sequence[Turned]) -> Seen:
    assert rig.shaft is not None
    phase = (
        round(2 * math.pi / electrical_turn(rig, plane.motor).value)
        if plane.motor in rig.capabilities.force_currents
        else 1
    )
    per = ratio(rig, plane).value
    current, reading, whole, other = [], [], [], []
    for t in turned:
        (i, i_other), (e, e_other) = (
            fit.vectors(t.angle, t.channels[x], t.channels[y], rig.shaft.sense, phase)
            for x, y in (plane.currents, plane.positions)
        )
        current.append(i)
        reading.append(e)
        whole.append(per * i + e)
        other.append(per * i_other + e_other)
    return Seen(plane, place, tuple(t.sign for t in turned), tuple(current), tuple(reading), tuple(whole), tuple(other))


def _scatter(some: Sequence[tuple[tuple[int, ...], tuple[complex, ...]]]) -> tuple[float, int]:
    """Of turns of one way, plane and place about their mean, all together: of a mean over one place's turns; degrees of
    freedom."""
    left, dof = 0.0, 0
    for signs, vectors in some:
        for sign in (1, -1):
            v = np.array([x for x, s in zip(vectors, signs, strict=True) if s == sign])
            left += float(np.sum(np.abs(v - v.mean()) ** 2))
            dof += 2 * (v.size - 1)
    return math.sqrt(left / dof / len(some[0][0])), dof


def mean(vectors: Sequence[complex], signs: Sequence[int]) -> complex:
    """Of both ways alike."""
    return complex(
        np.mean([np.mean([v for v, s in zip(vectors, signs, strict=True) if s == sign]) for sign in (1, -1)])
    )


def _estimates(s: Seen, rig: RigFile, plan: Plan, u_current: float, u_whole: float, dof: int) -> Found:
    current, whole = mean(s.current, s.signs), mean(s.whole, s.signs)
    left = whole - ratio(rig, s.plane).value * current  # of the readings
    per, amperes, turned = ratio(rig, s.plane), 1 / gain(rig, s.plane), _turned(s.plane, rig, plan)
    out: Found = {}
    for k, part in enumerate(PARTS):
        where = f"{s.plane.name}, {s.place}, {part}"
        along = (current.real, current.imag)[k]
        across = (-current.imag, current.real)[k]  # by how much a turn of one moves it
        noise = {
            name: Influence(
                f"scatter/{where}/{name}",
                "scatter of the turns",
                u,
                unit,
                "A",
                "normal",
                dof,
                source="turns of one kind",
            )
            for name, u, unit in (("current", u_current, "A"), ("both", u_whole, "m"))
        }
        out["runout_current", where] = amperes * along + Estimate.of(0.0, noise["current"])
        out["runout", where] = per * (turned * across + along) + Estimate.of((left.real, left.imag)[k], noise["both"])
    return out


def _turned(plane: Plane, rig: RigFile, plan: Plan) -> Estimate:
    """Forces turn by what the zero of the motor's encoder is off, rad electrical, which is nowhere else in these data."""
    one: Mapping[str, object] = rig.capabilities.force_currents
    if plane.motor not in one:
        return Estimate.exact(0.0, "1")
    of = rig.capabilities.force_currents[plane.motor]
    told = plan.parameters.get(of.zero, rig.parameters[of.zero].default) if of.zero in rig.parameters else 0.0
    zero = certified(
        f"capabilities/force_currents/{plane.motor}/stated", of.stated, f"zero of the encoder, {plane.motor}"
    )
    return Estimate((zero - told).value, "1", zero.sensitivities)
