"""The pole of each axis, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.rigfile.places import Places
from bench.uncertainty import Estimate, Influence
from procedures.shared.certificates import certified, certified_gain
from procedures.unstable_pole import fit
from procedures.unstable_pole.fit import Release, Shot
from procedures.unstable_pole.hold import ability, chosen, foreseen, place
from procedures.unstable_pole.plan import Plan
from procedures.unstable_pole.steps import Taken

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Result:
    """Of one axis: the shots that tell of it, pushed along it or not, what was fitted to them, how far a push along it takes
    u and d to its side, `growth` and `tilt` m with standard uncertainties, and the quantities."""

    axis: str
    shots: tuple[Taken, ...]
    release: Release
    growth: tuple[float, float]
    tilt: tuple[float, float]
    estimates: Mapping[str, Estimate] = field(default_factory=dict)


def results(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> tuple[list[Result], list[Finding]]:
    """Each axis', and what could not be told."""
    out, failed = [], []
    least = round(plan.least_s * 1 / taken[0].step_s) if taken and taken[0].step_s else 1
    shots = tuple(t for t in taken if t.z and len(t.z[t.axis]) >= least)
    for axis in chosen(rig, plan):
        try:
            start = foreseen(rig, plan, ability(rig).axes[axis]).pole
            step_s = shots[0].step_s if shots else 1.0
            release = fit.release([Shot(t.z[axis], t.held) for t in shots], step_s, start)
            square = _square(release, axis, rig, plan)
        except AnalysisError as error:
            failed.append(Finding("pole-not-told", f"{axis}: {error}.", axis, Effect.INDETERMINATE,
                                  (f"pole@{axis}", f"stiffness@{axis}")))  # fmt: skip
            continue
        growth, tilt = went(shots, axis, release)
        mass = certified(ability(rig).mass, Places(rig).known[ability(rig).mass], "mass")
        found = {"pole": square**0.5, "stiffness": square * mass}
        out.append(Result(axis, shots, release, growth, tilt, found))
    return out, failed


def _square(release: Release, axis: str, rig: RigFile, plan: Plan) -> Estimate:
    """K/m = L_uu + (c/l) L_du + (g_1 - g_2)/2 (L_ud - L_du), 1/s^2: how far the centre of mass is off the middle, and
    probes that tell different lengths."""
    l_half = half_distance(rig, axis)
    at, middle = place(rig, plan), ability(rig).middle
    off = 0.0 if at is None or middle is None else at - middle.value
    (uu, ud), (du, _) = release.square
    slopes = np.array([1.0, 0.0, off / l_half, 0.0])
    scatter = Influence(id=f"scatter/{axis}/pole", name="noise and counts of the readings",
                        u=math.sqrt(float(slopes @ release.covariance @ slopes)), unit="1/s^2", kind="A",
                        distribution="normal", dof=float(release.dof), source="what is left of the fit")  # fmt: skip
    out = Estimate.exact(float(uu + off / l_half * du), "1/s^2") + Estimate.of(0.0, scatter)
    if middle is not None:
        moved = certified("capabilities/hold/middle", middle, "where the centre of mass is") - middle.value
        out = out - moved * (float(du) / l_half)
    first, second = ability(rig).axes[axis].positions
    if first in rig.sensors and second in rig.sensors:
        ratio = certified_gain(rig, first) / rig.sensors[first].gain.value
        ratio = ratio - certified_gain(rig, second) / rig.sensors[second].gain.value
        out = out + ratio * (float(ud - du) / 2)
    return Estimate(out.value, "1/s^2", out.sensitivities)


def half_distance(rig: RigFile, axis: str) -> float:
    """Of the planes in which the probes of an axis are, m."""
    names = {probe.channel: name for name, probe in rig.probes.items()}
    one, other = (f"probes/{names[c]}" for c in ability(rig).axes[axis].positions)
    return abs(Places(rig).distance(one, other).value) / 2


def went(some: Sequence[Taken], axis: str, release: Release) -> tuple[tuple[float, float], tuple[float, float]]:
    """How far a push along an axis takes u and d to its side from rest, by the fit, until the end of the shortest shot, m, with
    standard uncertainties: half of what differs between the mean currents of both ways pushes. How each shot began is no part
    of it, as it is of where it ended."""
    pushed = [t for t in some if t.axis == axis]
    ways = [np.array([t.held for t in pushed if t.push * sign > 0]) for sign in (1, -1)]
    if min(len(way) for way in ways) < 2:
        return (0.0, math.inf), (0.0, math.inf)
    half = np.append((ways[0].mean(axis=0) - ways[1].mean(axis=0)) / 2, 0.0)
    last = (min(len(t.z[axis]) for t in pushed) - 1) * pushed[0].step_s
    _, forces = fit.basis(release.square, np.array([last]))
    size = forces[0] @ (release.pushed @ half)
    spread = forces[0] ** 2 @ np.einsum("i,rij,j->r", half, release.pushed_covariance, half)
    return (float(size[0]), math.sqrt(spread[0])), (float(size[1]), math.sqrt(spread[1]))
