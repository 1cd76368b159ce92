"""Drag of a levitated rotor from its run-downs: B at two bias currents, Coulomb torque and, with a ring, the inertia.

With b and c of `spindown`, B = J b and T_c = J c. The eddy currents' part of B goes with the square of the bearings' flux
and so with q, the mean over the radial axes that hold the shaft of ((i_p + i_n)/2)^2. The coil currents, freed of their
sensors' offset and gain, say which q a coast really had; the straight line of B over q through both biases gives B at exactly
the nominal ones.

A constant torque of the motor (an offset of its current sensors) brakes one way and drives the other: it drops out of the
mean over the directions, and half of the difference of c is that torque over J.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence, propagate
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.shared.certificates import certified, certified_sensors
from procedures.spindown.fit import Coast, inertia_from_ring
from procedures.spindown.plan import Plan
from procedures.spindown.requires import coils
from procedures.spindown.steps import RunDown

Array = npt.NDArray[np.float64]
METHODS: Mapping[str, Callable[[RunDown], Coast]] = {"angle": lambda r: r.of_angle, "speed": lambda r: _by_speed(r)}
RESIDUAL_DOF = 30.0  # of a covariance from correlated residuals: a coast holds some thirty independent stretches


@dataclass(frozen=True)
class Rates:
    """Mean of b (1/s) and c (rad/s^2) over directions and repeats: `values` (2,), Type A `covariance` (2, 2) with `dof`;
    `by_direction` {+1: (2,), -1: (2,)}; `ratio` of the scatter of repeats to what the residuals let expect (variances)."""

    values: Array
    covariance: Array
    dof: float
    by_direction: Mapping[int, Array]
    ratio: float
    ratio_dof: int


@dataclass(frozen=True)
class Drag:
    """Estimates by quantity name, and the rates they are made of by group ("low", "high", "ring")."""

    estimates: Mapping[str, Estimate]
    rates: Mapping[str, Rates]
    torque: Estimate  # constant torque in the forward direction, N m
    seen: Estimate  # Coulomb torque as the run-downs show it, the drive's drag in it, N m


def grouped(runs: Sequence[RunDown], bias_A: float) -> dict[str, list[RunDown]]:
    """Run-downs by what they are for: "low" and "high" bias, and "ring" at the low bias."""
    out: dict[str, list[RunDown]] = {}
    for r in runs:
        out.setdefault("ring" if r.ring else "low" if r.bias_A == bias_A else "high", []).append(r)
    return out


def _by_speed(run: RunDown) -> Coast:
    if run.of_speed is None:
        raise AnalysisError(f"run-down {run.where}: found no fit of its speed; expected one (it is too short)")
    return run.of_speed


def rates(runs: Sequence[RunDown], coast: Callable[[RunDown], Coast]) -> Rates:
    """Mean rates of one group and their Type A covariance.

    The residuals of each fit, their correlation in time allowed for, say how far a run-down may be off; where the repeats
    scatter more than that, their scatter counts instead (ratio of the variances, both terms taken together).

    Raises:
        AnalysisError: a direction is missing.
    """
    ways = {d: [coast(r) for r in runs if r.direction == d] for d in (1, -1)}
    if not all(ways.values()):
        raise AnalysisError("run-downs: found one direction only; expected both (was the run stopped early?)")
    values = {d: np.array([[c.b, c.c] for c in found]) for d, found in ways.items()}
    expected = np.mean([c.covariance for found in ways.values() for c in found], axis=0)
    apart = np.concatenate([v - v.mean(axis=0) for v in values.values()])
    root = np.linalg.cholesky(expected)
    white = np.linalg.solve(root, apart.T)
    dof = 2 * sum(len(v) - 1 for v in values.values())
    alike = [np.array([c.shared for c in found]) for found in ways.values()]
    if alike[0].any():  # what all share makes them differ, too, and is in the mean by itself
        beside = np.concatenate([np.linalg.solve(root, s - s.mean(axis=0)) for s in alike])
        beside = beside.reshape(white.size, -1)
        white = white.T.ravel() - beside @ np.linalg.lstsq(beside, white.T.ravel(), rcond=None)[0]
        dof -= beside.shape[1]
    ratio = float((white**2).sum() / dof) if dof > 0 else 1.0
    means = {d: v.mean(axis=0) for d, v in values.items()}
    share = sum(1 / len(v) for v in values.values()) / 4
    wide = max(ratio, 1.0)
    shared = sum((s.mean(axis=0) for s in alike), np.zeros((2, 1))) / 2
    return Rates(
        (means[1] + means[-1]) / 2,
        expected * wide * share + shared @ shared.T,
        RESIDUAL_DOF if wide == 1.0 else float(dof),
        means,
        ratio,
        max(dof, 0),
    )


def evaluate(runs: Sequence[RunDown], rig: RigFile, method: str, plan: Plan) -> Drag:
    """B, B_high, T_c (and J_z with a ring) by one of METHODS, with all influences.

    Raises:
        AnalysisError: a bias or a direction is missing, a run-down is too short for that method, or the ring does not slow the
            decay.
    """
    bias_A, bias_high_A = plan.bias_A, plan.bias_high_A
    groups = grouped(runs, bias_A)
    if not {"low", "high"} <= groups.keys():
        raise AnalysisError(f"run-downs: found {', '.join(groups)}; expected both biases (was the run stopped early?)")
    found = {name: rates(members, METHODS[method]) for name, members in groups.items()}
    inputs = _inputs(rig, "ring" in groups)
    for name, r in found.items():
        inputs |= _type_a(name, method, r)
    currents = {
        name: {c: float(np.mean([r.coils[c] for r in members])) for c in members[0].coils}
        for name, members in groups.items()
    }
    pairs = held_by(conventions(rig), plan.motor_carries)

    def model(p: dict[str, float]) -> dict[str, float]:
        inertia, c = p.get("inertia", 0.0), p["c_low"]
        out: dict[str, float] = {}
        if "ring" in found:
            inertia = out["J_z"] = inertia_from_ring(p["b_low"], p["b_ring"], p["ring"])
            c = (c + (1 + p["ring"] / inertia) * p["c_ring"]) / 2
        q = {name: square(currents[name], pairs, p) for name in ("low", "high")}
        slope = (p["b_high"] - p["b_low"]) / (q["high"] - q["low"])
        at = {
            k: inertia * (p["b_low"] + slope * (bias**2 - q["low"]))
            for k, bias in (("B", bias_A), ("B_high", bias_high_A))
        }
        return {**at, "T_c": inertia * c - p["drag"], "seen": inertia * c, **out, "torque": inertia * p["torque"]}

    inputs["torque"] = Estimate.exact(float(found["low"].by_direction[-1][1] - found["low"].by_direction[1][1]) / 2)
    out = propagate(model, inputs)
    torque, seen = out.pop("torque"), out.pop("seen")
    return Drag(out, found, torque, seen)


def stated_inertia(rig: RigFile) -> Estimate:
    """The rig file's polar inertia, kg m^2."""
    return certified("machine/polar_inertia", rig.machine["polar_inertia"], "polar inertia of the rotor")


def drive_drag(rig: RigFile) -> Estimate:
    """What the external drive's own bearings take from a rotor that coasts, N m; nothing where the rig file says nothing."""
    if "drive_drag" not in rig.machine:
        return Estimate.exact(0.0, "N m")
    return certified("machine/drive_drag", rig.machine["drive_drag"], "drag of the external drive")


def _inputs(rig: RigFile, ring: bool) -> dict[str, Estimate]:
    out = {"drag": drive_drag(rig)}
    if ring:
        out["ring"] = certified("machine/ring_inertia", rig.machine["ring_inertia"], "inertia of the ring")
    else:
        out["inertia"] = stated_inertia(rig)
    return out | certified_sensors(rig, {c: c for c in coils(conventions(rig))})


def _type_a(group: str, method: str, r: Rates) -> dict[str, Estimate]:
    """b and c of a group as estimates with two independent influences that carry their covariance."""
    root = np.linalg.cholesky(r.covariance)
    parts = [
        Influence(id=f"scatter/{method}/{group}/{k + 1}", name=f"scatter of the run-downs, {group} ({k + 1})", u=1.0,
                  unit="1", kind="A", distribution="normal", dof=r.dof, source="residuals and repeats of the run-downs")
        for k in range(2)
    ]  # fmt: skip
    b = Estimate.of(0.0, parts[0]) * float(root[0, 0]) + float(r.values[0])
    c = (
        Estimate.of(0.0, parts[0]) * float(root[1, 0])
        + Estimate.of(0.0, parts[1]) * float(root[1, 1])
        + float(r.values[1])
    )
    return {f"b_{group}": b, f"c_{group}": c}


def held_by(machine: Servomotor, motor_carries: bool) -> tuple[tuple[str, str], ...]:
    """The pairs of coils that hold the shaft: of both radial AMBs, or where the motor carries of the inboard one."""
    return tuple(pair for role, pair in machine.coils.items() if not motor_carries or role.endswith("i"))


def square(currents: Mapping[str, float], pairs: Collection[tuple[str, str]], p: Mapping[str, float]) -> float:
    """Mean over radial axes, by their `pairs` of coils, of the squared mean current of both, A^2, freed of the sensors'
    errors."""
    true = {c: (i - p[f"offset_{c}"]) / p[f"gain_{c}"] for c, i in currents.items()}
    return math.fsum(((true[one] + true[other]) / 2) ** 2 for one, other in pairs) / len(pairs)
