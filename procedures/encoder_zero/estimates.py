"""Zeros of each motor and ratios of their constants, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.encoder_zero import fit
from procedures.encoder_zero.fit import Field
from procedures.encoder_zero.groups import ALONG, PLACES, Group, groups, loop_of, settle_s, slowest_s, step_of, zeros
from procedures.encoder_zero.plan import Plan
from procedures.encoder_zero.steps import Answers, Taken, answers, column
from procedures.position_loops.motors import electrical_turn, phase_rate
from procedures.shared.certificates import certified_gain

Array = npt.NDArray[np.float64]
RAD = "rad"
SOFTER = (
    0.2  # share of a loop's stiffness that cogging may have: forces balance at once but for what it changes on the way
)


@dataclass(frozen=True)
class At:
    """A group at a place: its answers, the field by their means, angles (repeats, n) by each repeat alone."""

    answers: Answers
    field: Field
    angles: Array
    logs: Array  # logarithms of the constants, alike


@dataclass(frozen=True)
class Result:
    """Of one group: what each place showed, and each with one motor's zero changed, by that motor; quantities by name and
    motor or pair; `apart`, by motor, how far the places are from one another, with what may make it; `turns`, by motor, the
    angle by which its currents are laid too far, rad."""

    group: Group
    places: Sequence[At]
    trials: Mapping[str, At]
    estimates: Mapping[tuple[str, str], Estimate] = field(default_factory=dict)
    apart: Mapping[str, Estimate] = field(default_factory=dict)
    turns: Mapping[str, float] = field(default_factory=dict)


def results(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> list[Result]:
    """Each group's that was looked at whole.

    Raises:
        AnalysisError: the answers of one do not tell its motors apart.
    """
    out = []
    for group in groups(rig, plan):
        places = [at(a) for k in range(PLACES) if (a := answers(taken, group, k)) is not None]
        if len(places) < PLACES:
            continue
        trials = {m: at(a) for m in group.motors if (a := answers(taken, group, PLACES - 1, m)) is not None}
        out.append(_of_group(group, places, trials, rig, plan))
    return out


def at(found: Answers) -> At:
    """The field at a place."""
    each = [fit.field(rows) for rows in found.rows]
    whole = fit.field(found.rows.mean(axis=0))
    return At(found, whole, np.array([f.angle for f in each]), np.log([f.constant for f in each]))


def _of_group(group: Group, places: Sequence[At], trials: Mapping[str, At], rig: RigFile, plan: Plan) -> Result:
    out: dict[tuple[str, str], Estimate] = {}
    apart, turns = {}, {}
    for j, motor in enumerate(group.motors):
        each = [_zero(motor, p, float(p.field.angle[j]), rig) for p in places]
        mean = sum(each[1:], each[0]) / len(each)
        scatter = _scatter(f"{motor}", np.array([p.angles[:, j] for p in places]), RAD)
        turns[motor] = float(np.mean([p.field.angle[j] for p in places]))
        share = SOFTER * math.exp(-settle_s(rig, plan, group) / slowest_s(rig, group.loop))
        left = share * abs(math.tan(turns[motor]))
        unsettled = Influence(f"settling/{motor}", "what is left of the loop's settling", left / math.sqrt(3), RAD, "B",
                              "rectangular", source="the loop's gains, time waited")  # fmt: skip
        out["zero", motor] = mean + Estimate.of(0.0, scatter) + Estimate.of(0.0, unsettled)
        apart[motor] = each[0] - each[1] + Estimate.of(0.0, scatter) * 2.0
    for one in group.motors[:-1]:
        out["K_ratio", f"{one}/{group.motors[-1]}"] = _ratio(group, one, places, rig)
    return Result(group, places, trials, out, apart, turns)


def _zero(motor: str, place: At, angle: float, rig: RigFile) -> Estimate:
    """By one place. The controller's phase is 2 pi reading/period - zero', the field's 2 pi (reading/gain)/period - zero; the
    former is ahead by `angle`."""
    one, reading = zeros(rig)[motor], place.answers.reading
    channel = loop_of(rig, place.answers.group.loop).channel
    true = reading / certified_gain(rig, channel) if channel in rig.sensors else Estimate.exact(reading)
    period = electrical_turn(rig, motor)
    known = rig.parameters[one.zero].default
    phase = phase_rate(rig, motor) * reading
    field_phase = 2 * math.pi * true / period
    out = Estimate(field_phase.value, RAD, field_phase.sensitivities) + (angle + known - phase)
    for name, slope in zip(rig.motors[motor].currents, _gains(rig, motor, angle, phase - known)[0], strict=True):
        out = out + slope * (_gain(rig, name) - 1)
    rounded = Estimate(0.0, RAD, {_rounding(place, rig): phase_rate(rig, motor)})
    return out + rounded + Estimate.of(0.0, _rounded_currents(motor, place, rig))


def _gain(rig: RigFile, channel: str) -> Estimate:
    gain = certified_gain(rig, channel)
    return Estimate(gain.value, RAD, gain.sensitivities)


def _gains(rig: RigFile, motor: str, angle: float, phase: float) -> tuple[Array, Array]:
    return fit.turned(angle, phase, len(rig.motors[motor].currents))


def _rounding(place: At, rig: RigFile) -> Influence:
    """What rounding does to the mean reading. A place `f` of a count beside a count's middle is read, in the mean over noise of
    standard deviation s counts, as f - exp(-2 pi^2 s^2) sin(2 pi f)/pi and harmonics that are smaller: on a count it is read
    as it is, and a loop with an integrator holds the mean reading."""
    loop = place.answers.group.loop
    channel = loop_of(rig, loop).channel
    assert rig.capture is not None
    count, unit = rig.capture.channels[channel].scale, rig.channels[channel].unit
    beside = abs(math.sin(2 * math.pi * place.answers.reading / count))
    noise = max(place.answers.noise[0] ** 2 / count**2 - 1 / 12, 0.0)  # squares of counts
    off = count / math.pi * math.exp(-2 * math.pi**2 * noise) * beside
    name = f"rounding of {channel} at place {place.answers.place + 1}"
    return Influence(f"rounding/{loop}/{place.answers.place}", name, off / math.sqrt(3), unit, "B", "rectangular")


def _rounded_currents(motor: str, place: At, rig: RigFile) -> Influence:
    """What rounding the captured dq currents does to an angle. They are made of the counts Q of n coils at three angles, n/3 at
    each: of so few values that rounding them to q once more does not average out, alike each time. Of independent errors of
    rounding the mean keeps q/sqrt(12) times the root of the sum of squares of their shares: for normal counts of standard
    deviation s at each angle that is (2 sqrt(pi) s)^(-3/2), s = n/sqrt(6) of the least of a dq current in Q. Each answer is
    half of the difference of two means, and an angle the sum of one of each motor, over what is stepped."""
    found, channel = place.answers, step_of(rig, motor).along
    coils = rig.motors[motor].currents
    assert rig.capture is not None
    known = rig.capture.channels
    count = max((known[c].scale for c in coils if c in known), default=0.0)
    own = column(found.group, motor, ALONG)
    noise = float(
        min((s for s in found.noise[1:] if s > 0), default=0.0)
    )  # of what flows there is more, and alike in all
    counts = len(coils) / math.sqrt(6) * noise / count if count else math.inf
    kept = min((2 * math.sqrt(math.pi) * counts) ** -1.5, 1.0) if counts > 0 else 1.0
    stepped = abs(float(found.pairs[:, found.group.stepped.index((motor, ALONG)), own].mean()))
    u = known[channel].scale / math.sqrt(12) * kept * math.sqrt(len(found.group.motors) / 2) / stepped
    name = f"rounding of the currents at place {found.place + 1}"
    return Influence(
        f"rounded currents/{motor}/{found.place}", name, u, RAD, "B", "normal", source="counts of the currents"
    )


def _scatter(name: str, each: Array, unit: str) -> Influence:
    """Of repeats (places, repeats) about the mean of their place."""
    dof = each.size - len(each)
    u = math.sqrt(float(each.var(axis=1, ddof=1).mean()) / each.size)
    return Influence(f"scatter/{name}", "scatter of the repeats", u, unit, "A", "normal", float(dof))


def _ratio(group: Group, one: str, places: Sequence[At], rig: RigFile) -> Estimate:
    """Of a motor's constant over the last one's."""
    j, last = group.motors.index(one), len(group.motors) - 1
    logs = np.array([p.logs[:, j] - p.logs[:, last] for p in places])
    value = math.exp(float(np.mean([math.log(p.field.constant[j] / p.field.constant[last]) for p in places])))
    scatter = _scatter(f"{one}/{group.motors[-1]}", logs * value, "1")
    out = Estimate.exact(value, "1") + Estimate.of(0.0, scatter)
    for k, sign in ((j, 1.0), (last, -1.0)):
        motor = group.motors[k]
        known = rig.parameters[zeros(rig)[motor].zero].default
        slopes = np.mean([_gains(rig, motor, float(p.field.angle[k]), phase_rate(rig, motor) * p.answers.reading - known)[1]
                          for p in places], axis=0)  # fmt: skip
        for name, slope in zip(rig.motors[motor].currents, slopes, strict=True):
            out = out + value * sign * float(slope) * (certified_gain(rig, name) - 1)
    return out


def differences(found: Result) -> dict[tuple[str, str], Estimate]:
    """Zeros of the motors of a loop less that of the last one."""
    last = found.group.motors[-1]
    return {(m, last): found.estimates["zero", m] - found.estimates["zero", last] for m in found.group.motors[:-1]}


def shifts(found: Result, trial: str) -> dict[str, float]:
    """By how much each motor's zero went, rad, as the parameter of one was changed; that one's should have, by as much back."""
    base, changed = found.places[-1].field.angle, found.trials[trial].field.angle
    return {m: float(changed[j] - base[j]) for j, m in enumerate(found.group.motors)}
