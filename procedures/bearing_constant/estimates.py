"""Constants of both planes with influences, and where the weights hung by the currents."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.bearing_constant import fit
from procedures.bearing_constant.fit import Answer
from procedures.bearing_constant.plan import Plan
from procedures.bearing_constant.stand import Plane, hooks, phase, planes
from procedures.bearing_constant.steps import Array, Visit, design
from procedures.shared.certificates import certified, certified_gain
from procedures.shared.leastsquares import linear

Found = dict[tuple[str, str], Estimate]
K_B, K_MEAN = "K_B", "K_mean"


@dataclass(frozen=True)
class Result:
    """`answers` of the planes; `places`, m from the middle between the planes, where each weight hung by the currents, and its
    standard uncertainty; `forces` (n,) N of each visit; `scatter` N of a visit's force, and `tilting` N (n,) what the far plane
    carries more than the other, off the fit; the quantities by name and place."""

    hooks: tuple[str, ...]
    planes: tuple[Plane, ...]
    answers: tuple[Answer, ...]
    visits: tuple[Visit, ...]
    places: Mapping[str, tuple[float, float]]
    forces: Array
    scatter: float
    tilting: Array
    estimates: Found


def result(visits: Sequence[Visit], rig: RigFile, plan: Plan) -> Result:
    """Of all visits.

    Raises:
        AnalysisError: too few of them, or weights that tell nothing.
    """
    at, two = hooks(rig, plan), planes(rig)
    x = design(visits, at)
    answers = tuple(fit.answer(x, np.array([v.currents[k] for v in visits if v.currents is not None])) for k in (0, 1))
    first, other = (a.rates for a in answers)
    scale, gains = _weights(visits, rig), [_gain(rig, plan, p, a) for p, a in zip(two, answers, strict=True)]
    told = len(at) == 2
    per = fit.forces(first, other) if told else np.full(2, 1 / float(first[0] + other[0]))
    forces = per[0] * answers[0].along + per[1] * answers[1].along
    together = linear(x, forces)  # N of both planes: what scatters in both alike is in it as it should be
    scatter = _parts(together.covariance[: len(at), : len(at)], together.dof)
    found: Found = {}
    for j, hook in enumerate(at):
        share, sum_ = float(first[j] / (first[j] + other[j])), float(first[j] + other[j])
        read = _scattered(1 / sum_, np.eye(len(at))[j] / -sum_, scatter)
        found[K_MEAN, hook] = read * scale * (gains[0] * share + gains[1] * (1 - share))
    for k, row in enumerate(-np.linalg.inv(np.column_stack([first, other])) if told else ()):
        found[K_B, two[k].motor] = _scattered(float(per[k]), row, scatter) * scale * gains[k]
    places = dict(_places(answers, two, at)) if told else {}
    rest = math.sqrt(float(together.residuals @ together.residuals) / together.dof)
    tilting = per[0] * answers[0].left - per[1] * answers[1].left
    return Result(at, two, answers, tuple(visits), places, forces, rest, tilting, found)


def _parts(covariance: Array, dof: int) -> list[tuple[Influence, Array]]:
    """Of what both planes carry of a newton on each hook: independent parts of its scatter."""
    return [(Influence(f"scatter/{m + 1}", "scatter of the visits", 1.0, "1", "A", "normal", dof, source="visits"), part)
            for m, part in enumerate(np.linalg.cholesky(covariance).T)]  # fmt: skip


def _scattered(value: float, slope: Array, scatter: Sequence[tuple[Influence, Array]]) -> Estimate:
    """N/A, with its `slope` by what both planes carry of a newton on each hook."""
    return Estimate(value, "N/A", {one: float(slope @ part) for one, part in scatter})


def _gain(rig: RigFile, plan: Plan, plane: Plane, a: Answer) -> Estimate:
    """What is read for a true ampere of the current that answers. Where coil k carries p_k of it, i = 2/n sum of p_k i_k."""
    turn = phase(rig, plan, plane)
    d, q = math.sin(a.turned), math.cos(a.turned)
    carries = np.array([d * math.cos(turn + math.radians(p)) - q * math.sin(turn + math.radians(p))
                        for p in plane.system.coils.values()])  # fmt: skip
    out = Estimate.exact(0.0, "1")
    for coil, share in zip(plane.system.coils, carries**2 / float(carries @ carries), strict=True):
        out = out + certified_gain(rig, coil) * float(share)
    return out


def _weights(visits: Sequence[Visit], rig: RigFile) -> Estimate:
    """What hung over what was taken for it: each mass by its part of the fit, and gravity."""
    squares = {
        label: sum(v.newtons**2 for v in visits if v.load == label) for label in {v.load for v in visits if v.load}
    }
    out = Estimate.exact(0.0, "1")
    for label in sorted(squares):
        mass = rig.masses[label]
        share = squares[label] / sum(squares.values())
        out = out + certified(f"masses/{label}", mass, f"mass {label}") * (share / mass.value)
    return out * certified("site/gravity", rig.site.gravity, "gravity") / rig.site.gravity.value


def _places(
    answers: Sequence[Answer], two: Sequence[Plane], at: Sequence[str]
) -> Iterator[tuple[str, tuple[float, float]]]:
    """By hook, m from the middle between the planes; its uncertainty by the scatter alone."""
    half = (two[0].at - two[1].at) / 2
    per = fit.forces(answers[0].rates, answers[1].rates)
    for j, hook in enumerate(at):
        u = math.hypot(*(per[k] * math.sqrt(answers[k].covariance[j, j]) for k in (0, 1)))
        yield hook, (float(half * (per[0] * answers[0].rates[j] - per[1] * answers[1].rates[j])), float(half * u))
