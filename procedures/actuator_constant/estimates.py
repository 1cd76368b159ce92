"""Constants of each motor, the slope of cogging at each place and the ratio of two motors, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.actuator_constant import fit
from procedures.actuator_constant.fit import Line, Response
from procedures.actuator_constant.plan import Plan
from procedures.actuator_constant.ring import inertias
from procedures.actuator_constant.sines import Place, loops, places, with_the_ring
from procedures.actuator_constant.steps import Added, Array, Taken, with_ring
from procedures.position_loops.injection import ability
from procedures.position_loops.lines import counted
from procedures.position_loops.motors import around, cosine, inertia, motors, off, phase_rate
from procedures.shared.certificates import certified_gain

Found = dict[tuple[str, str], Estimate]


@dataclass(frozen=True)
class Looked:
    """A loop at a place: its sines, the lines of them by the motors' currents taken together, what was fitted, and of each
    motor its constant there."""

    place: Place
    taken: list[Taken]
    lines: list[Line]
    response: Response
    constants: Mapping[str, Estimate]


@dataclass(frozen=True)
class Result:
    """Of one loop: what was seen at each place, K_1/K_2 of two motors per ampere that is read (None: one motor, or not looked
    at), and the quantities by name and place; `ringed`: the same places with the ring on, and what turns by each."""

    loop: str
    looked: list[Looked]
    ratio: Estimate | None = None
    estimates: Found = field(default_factory=dict)
    ringed: list[Looked] = field(default_factory=list)
    inertias: list[Estimate] = field(default_factory=list)


def results(
    taken: Sequence[Taken],
    added: Sequence[Added],
    rig: RigFile,
    plan: Plan,
    zeros: Mapping[str, Estimate] | None = None,
) -> list[Result]:
    """Each loop's; `zeros`, rad, as they were measured, by `zero@` and the motor.

    Raises:
        AnalysisError: lines that fit no mass.
        NotSeen: a ring makes no difference.
    """
    lost = {m: cosine(rig, m, off(rig, plan.parameters, m, zeros)) for m in rig.capabilities.force_currents}
    of = {loop: [a for a in added if a.common.loop == loop] for loop in loops(rig, plan)}
    return [_result(loop, taken, some, rig, plan, lost) for loop, some in of.items()]


def _result(loop: str, taken: Sequence[Taken], added: Sequence[Added], rig: RigFile, plan: Plan,
            lost: Mapping[str, Estimate]) -> Result:  # fmt: skip
    driving = list(motors(rig, loop))
    ratio, shares = None, {name: 1 / len(driving) for name in driving}
    if added and len(driving) == 2:
        there = _there(taken, loop, added[0].common.place)
        _, alike = _seen(there, shares, rig)
        ratio = _read_ratio(added, driving, alike.slope, loop)
        shares = {driving[0]: ratio.value / (1 + ratio.value), driving[1]: 1 / (1 + ratio.value)}
    looked: list[Looked] = []
    ringed: list[Looked] = []
    for ring, into in ((False, looked), (True, ringed))[: 1 + (loop in with_the_ring(rig, plan))]:
        for place in places(rig, plan, loop):
            there = _there(taken, loop, place.name, ring)
            lines, response = _seen(there, shares, rig)
            constants = _constants(loop, there[0].common.at, there, lines, response, ratio, rig, lost)
            into.append(Looked(replace(place, name=there[0].common.at), there, lines, response, constants))
    found = inertias([x.constants for x in looked], [x.constants for x in ringed], rig) if ringed else []
    return Result(loop, looked, ratio, _estimates(loop, looked, ratio, added, rig, lost, found), ringed, found)


def _there(taken: Sequence[Taken], loop: str, place: str, ring: bool = False) -> list[Taken]:
    """The sines of a place, with the ring or without it.

    Raises:
        AnalysisError: there is none.
    """
    some = [t for t in taken if (t.common.loop, t.common.place, t.common.ring) == (loop, place, ring)]
    if not some:
        raise AnalysisError(f"no sines at {with_ring(place) if ring else place} (was the run stopped early?)")
    return some


def _seen(taken: Sequence[Taken], shares: Mapping[str, float], rig: RigFile) -> tuple[list[Line], Response]:
    """Lines of a place by the motors' currents together, each by its `shares` of the force, and what fits them."""
    lines = [fit.line(t.hz, t.position, _together(t, shares), t.periods) for t in sorted(taken, key=lambda t: t.hz)]
    u = [math.hypot(x.u, abs(x.ratio) * rounded(x, taken[0].common.loop, rig)) for x in lines]
    return lines, fit.response([x.hz for x in lines], [x.ratio for x in lines], u)


def _together(t: Taken, shares: Mapping[str, float]) -> Array:
    return np.asarray(sum(share * t.currents[name] for name, share in shares.items()))


def rounded(line: Line, loop: str, rig: RigFile) -> float:
    """Standard uncertainty of a line's position by its counts, as a share of it."""
    assert rig.capture is not None
    scale = rig.capture.channels[ability(rig).loops[loop].channel].scale
    return counted(scale, line.rms, line.position) / line.position


def _read_ratio(added: Sequence[Added], driving: Sequence[str], slope: float, loop: str) -> Estimate:
    """K_1/K_2 by the currents that are read; `slope` is k over both constants together."""
    first, other = (np.array([a.currents[name] for a in added]) for name in driving)
    value, u, dof = fit.shift_ratio(first, other, [a.position for a in added], 2 * slope)
    if not value > 0:
        raise AnalysisError(
            f"{loop}: {driving[0]} and {driving[1]} work against each other: their currents rise together"
        )
    return Estimate.of(value, Influence(f"scatter/{loop}/ratio", "scatter of the added currents", u, "1", "A", "normal", dof,
                                        source="steps at rest"))  # fmt: skip


def _per_ampere(loop: str, place: str, lines: Sequence[Line], response: Response) -> Estimate:
    """M/K with noise, and with what a low-pass in the place of a delay makes of it."""
    if not response.inertial > 0:
        raise AnalysisError(f"{loop}, {place}: the current falls where the mass should be pushed: the sign of the current or "
                            "of the position is exchanged")  # fmt: skip
    dof = float(np.mean([x.dof for x in lines]))
    noise = Influence(f"scatter/{loop}/{place}", "noise and counts of the readings", math.sqrt(response.covariance[0, 0]),
                      "A s^2/m", "A", "normal", dof, source="bins beside the lines; converter")  # fmt: skip
    bend = Influence(f"delay/{loop}/{place}", "low-pass or delay of the position", abs(response.inertial) * response.bend
                     / math.sqrt(3), "A s^2/m", "B", "rectangular", source="fit with either")  # fmt: skip
    return Estimate.of(response.inertial, noise) + Estimate.of(0.0, bend)


def _constants(loop: str, place: str, taken: Sequence[Taken], lines: Sequence[Line], response: Response,
               ratio: Estimate | None, rig: RigFile, lost: Mapping[str, Estimate]) -> dict[str, Estimate]:  # fmt: skip
    """K of each motor over what it moves."""
    driving, per = motors(rig, loop), _per_ampere(loop, place, lines, response)
    channel = ability(rig).loops[loop].channel
    all_of_it = 1 / per / (certified_gain(rig, channel) if channel in rig.sensors else 1.0)
    weights = coil_weights(taken)
    if len(driving) == 1:
        parts = dict.fromkeys(driving, all_of_it)
    else:
        whole = ratio if ratio is not None else Estimate.exact(1.0, "1")
        first, other = driving
        parts = {first: all_of_it * (whole / (1 + whole)), other: all_of_it / (1 + whole)}
    return {name: part * _gain(rig, name, weights[name]) * lost[name] for name, part in parts.items()}


def coil_weights(taken: Sequence[Taken]) -> dict[str, Array]:
    """By motor the share that each coil has of the force at a place: the square of its current's amplitude."""
    whole = next(t for t in taken if t.coils)
    return {name: each**2 / float(each @ each) for name, each in whole.coils.items()}


def _gain(rig: RigFile, motor: str, weights: Array) -> Estimate:
    """Of a current that coils carry: what is read a true ampere. Where current_k = p_k i, i = sum of (2/n) p_k current_k."""
    out = Estimate.exact(0.0, "1")
    for coil, weight in zip(rig.motors[motor].currents, weights, strict=True):
        out = out + certified_gain(rig, coil) * float(weight)
    return out


def _estimates(
    loop: str, looked: Sequence[Looked], ratio: Estimate | None, added: Sequence[Added], rig: RigFile,
    lost: Mapping[str, Estimate], found: Sequence[Estimate],
) -> Found:  # fmt: skip
    driving, turns = motors(rig, loop), around(rig, loop)
    moved = sum(found, Estimate.exact(0.0, "kg m^2")) * (1 / len(found)) if found else inertia(rig, loop)
    out: Found = {}
    mean = {name: sum((x.constants[name] for x in looked), Estimate.exact(0.0)) * (1 / len(looked)) for name in driving}
    if len(driving) == 1 or ratio is not None:
        out |= {("K_torque" if turns else "K_force", name): k * moved for name, k in mean.items()}
    if turns:
        out["K_over_J", loop] = sum(mean.values(), Estimate.exact(0.0))
    if found:
        out["inertia", loop] = moved
    if ratio is not None:
        weights = coil_weights(next(x for x in looked if x.place.name == added[0].common.place).taken)
        first, other = (_gain(rig, name, weights[name]) * lost[name] for name in driving)
        out["K_ratio", "/".join(driving)] = ratio * first / other
    for x in looked:
        name = "cogging_stiffness_angle" if turns else "cogging_stiffness"
        out[name, f"{loop}, {x.place.name}"] = _stiffness(loop, x, moved, mean, rig)
    return out


def _stiffness(loop: str, x: Looked, moved: Estimate, mean: Mapping[str, Estimate], rig: RigFile) -> Estimate:
    """k = M b/a of b = k/K and a = M/K: gains of both readings cancel. Offsets of the coils' readings, which turn with the
    phase, read as a slope of their own: K (d phase/dx) times their part along the field."""
    a, b, cov = x.response.inertial, x.response.slope, x.response.covariance
    k = b / a
    u = math.sqrt(max(cov[1, 1] - 2 * k * cov[0, 1] + k * k * cov[0, 0], 0.0)) / a
    dof, unit = float(np.mean([one.dof for one in x.lines])), "1/s^2"
    scatter = Influence(f"scatter/{loop}/{x.place.name}/slope", "noise and counts of the readings", u, unit, "A", "normal", dof,
                        source="bins beside the lines; converter")  # fmt: skip
    out, weights = Estimate.of(k, scatter), coil_weights(x.taken)
    for name, one in mean.items():
        u_offset = abs(one.value) * phase_rate(rig, name) * _offset(rig, name, weights[name])
        offsets = Influence(f"offset/{name}/{x.place.name}", f"offsets of the coils' readings, {name}", u_offset, unit, "B",
                            "normal", source="certificates of the current sensors")  # fmt: skip
        out = out + Estimate.of(0.0, offsets)
    return out * moved


def _offset(rig: RigFile, motor: str, weights: Array) -> float:
    """Standard uncertainty of the part along the field of all coils' offsets, A; 2/n p_q^2 are the `weights`."""
    coils = rig.motors[motor].currents
    across = 1 - weights * len(coils) / 2
    u = np.array([rig.sensors[c].offset.standard_uncertainty for c in coils])
    return 2 / len(coils) * math.sqrt(max(float(across @ u**2), 0.0))
