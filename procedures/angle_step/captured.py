"""From captured steps to estimates: what the steps that were made did, by what their captures can tell.

The response of the angle is a mean over both ways. Where a step begins within its encoder's count, and how far the angle's
integrator has learned by then, goes on from step to step in the same way each time, and is no error. How far steps are off that
trend is: it is noise, of the reading as of the machine, and near the end of its levitation, with amplifiers that cut, most of
what is not known. What is off in all steps alike has a term of its own. The shaft's path has noise, and its uncertainty is what
its mean says without one of the steps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.angle_step import amplitude, bounds, settling, steps
from procedures.angle_step.budget import OUTBOARD, at_motor, gained, placed, within
from procedures.angle_step.fine import Fine, fine
from procedures.angle_step.paths import Peak, levered, peak_of, slow
from procedures.angle_step.response import Response
from procedures.angle_step.settling import WAYS
from procedures.angle_step.standing import EACH, stands
from procedures.angle_step.steps import Case, Done
from procedures.angle_step.trend import noise
from procedures.servomotor.conventions import conventions
from procedures.shared.certificates import certified_gain

Array = npt.NDArray[np.float64]
TICKS = 0.03  # of a tick: a crossing, where steps that are alike meet the same ticks
EARLY = 0.01  # of a count: where the angle passes 10 %, with few edges before, in all steps alike
BETWEEN = 0.09  # of a count, over the counts of the step: what turning points are off in all steps alike, both ways
TOPS = 0.002  # of a count: and what the ticks of their edges make of them, which are the same ones each time


def by_case(
    moves: Sequence[Done],
    responses: Mapping[Case, Sequence[Response]],
    rig: RigFile,
    bands: Mapping[Case, float],
    count: float,
    kp: float,
) -> tuple[dict[Case, dict[str, Estimate]], dict[Case, int]]:
    """What captures add and what they say better, of the cases whose captures hold their steps; and how many are too short of
    each other. `bands` rad of settling, `count` rad of the encoder, `kp` A/rad."""
    whole: dict[Case, list[Fine]] = {}
    short: dict[Case, int] = {}
    done = {case: [d for d in of if d.swing is not None and not slow(float(d.swing.t[1]))]
            for case, of in steps.by_case(list(moves)).items()}  # fmt: skip
    for case, of in done.items():
        if min(sum((d.move.step > 0) is way for d in of) for way in WAYS) < 2:
            continue  # the run ended within this case
        found = [fine(d, d.swing, r.settling, bands[case], count)
                 for d, r in zip(of, responses[case], strict=False) if d.swing is not None]  # fmt: skip
        if any(f is None for f in found):
            short[case] = sum(f is None for f in found)
        elif found:
            whole[case] = [f for f in found if f is not None]
    return {c: _estimates(c, found, done[c], rig, count, kp) for c, found in whole.items()}, short


def _estimates(
    case: Case, found: Sequence[Fine], done: Sequence[Done], rig: RigFile, count: float, kp: float
) -> dict[str, Estimate]:  # fmt: skip
    where, swings = case.where, [d.swing for d in done if d.swing is not None]
    tick = float(swings[0].t[1])
    same = alike(case.size, count)
    between = _read(f"edges/{where}", "encoder between its counts",
                    max(f.course.unsure(same, count) for f in found), "rad")  # fmt: skip
    crossings = _read(f"ticks/{where}", "sampling", tick * TICKS / math.sqrt(2), "s")
    tops = _ways(found, [f.overshoot for f in found])
    starts = _ways(found, [f.began.edge for f in found])
    higher = (
        -float(np.mean(tops)) * count / case.size
    )  # by a start that is a count further: the step is smaller by that
    longer = float(np.mean([f.longer for f in found])) * count
    loose = _loose(where, found)
    top, dof = noise(tops, starts, higher)
    rises = _ways(found, [f.rise for f in found])
    out = {
        "rise_time": _repeated(f"rise_time/{where}", "s", rises, *noise(rises, starts, longer))
        + crossings * math.sqrt(2) + _in(loose * longer, "s")
        + _read(f"edges/rise/{where}", "encoder between its counts", EARLY * abs(longer), "s"),
        "overshoot": _repeated(f"overshoot/{where}", "1", tops, top, dof)
        + between * (1 / case.size) + _in(loose * higher, "1"),
        "settling_time": _settling(where, found, (top * case.size, dof), same, count) + crossings,
        "final_error": _final(where, found, done, count, kp),
        **_peaks(where, found, done, rig),
        **bounds.estimates(where, swings, rig, case.allocation == "priority"),
        **(amplitude.estimates(where, swings, rig) if bounds.bounded(rig) else {}),
    }  # fmt: skip
    cut = [f.saturated for f in found if f.saturated is not None]
    if len(cut) == len(found):
        out["saturated"] = _cut(where, _ways(found, cut), tick)
    return out


def alike(size: float, count: float) -> float:
    """What turning points are off in all steps alike, counts: the more edges a step passes, the less is left between them."""
    return math.hypot(BETWEEN * count / size, TOPS)


def _cut(where: str, ways: Sequence[Sequence[float]], tick: float) -> Estimate:
    """The mean of how long an amplifier cut, s, by whole ticks. Steps that are all alike do not show how rarely one is a tick
    off: the share that is lies within 2/n of n (0.217 of 10: Jeffreys, Beta(1/2, n + 1/2) at 97.5 %), which is u = tick/n.
    Where counts scatter by that or more, they show it themselves."""
    seen = _scattered(f"saturated/{where}", "s", ways)
    u = tick / sum(map(len, ways))
    if seen.u >= u:
        return seen
    return Estimate.of(seen.value, Influence(f"ticks/cut/{where}", "ticks of a cut", u, "s", "B", "normal"))


def _loose(where: str, found: Sequence[Fine]) -> Estimate:
    """Zero, with what chance does to the mean start, counts: one that is loose may be anywhere between two edges."""
    u = math.sqrt(sum(f.began.loose for f in found) / 12) / len(found)
    influence = Influence(id=f"start/{where}", name="at which edge a step begins", u=u, unit="1", kind="B",
                          distribution="normal")  # fmt: skip
    return Estimate.of(0.0, influence)


def _in(estimate: Estimate, unit: str) -> Estimate:
    """The same in a unit, which a factor has brought."""
    return Estimate(estimate.value, unit, estimate.sensitivities)


def _settling(
    where: str, found: Sequence[Fine], top: tuple[float, int], same: float, count: float
) -> Estimate:  # fmt: skip
    """The mean over the steps; `top`: what noise does to a turning point as it is read, rad, and the degrees of freedom by
    which it may be more; `same`: what turning points of all steps are off, counts."""
    of, noisy = [f.settled for f in found], (max(top[0], EACH * count), top[1])
    if settling.jumps(of, noisy, same, count):
        return settling.settled(where, of, noisy, same, count)
    times, starts = _ways(found, [s.time for s in of]), _ways(found, [f.began.edge for f in found])
    later = -float(np.mean([s.earlier(count) for s in of]))
    scattered = _repeated(f"settling_time/{where}", "s", times, *noise(times, starts, later))
    return scattered + settling.read(where, of, same, count) + _in(_loose(where, found) * later, "s")


def _final(where: str, found: Sequence[Fine], done: Sequence[Done], count: float, kp: float) -> Estimate:
    """The mean of how far beyond its reference the rotor stands, which is much the same in all steps of one way."""
    gains = [f.course.gain for f in found if math.isfinite(f.course.gain)]
    push = kp * count * float(np.median(gains)) if gains else math.nan
    at = [stands(d, count, push) for d in done]
    half = float(np.mean([a.half for a in at]))
    ways = [math.copysign(1.0, d.move.step) for d in done]
    return Estimate.exact(float(np.mean([w * a.error for w, a in zip(ways, at, strict=True)])), "rad") + within(
        f"standing/{where}", "where it stands by its counts", half, "rad"
    )


def _ways(found: Sequence[Fine], values: Sequence[float]) -> list[list[float]]:
    return [[v for v, f in zip(values, found, strict=True) if f.forward is way] for way in WAYS]


def _peaks(where: str, found: Sequence[Fine], done: Sequence[Done], rig: RigFile) -> dict[str, Estimate]:
    """How far the mean path of each way goes, as a mean over both."""
    machine = conventions(rig)
    gains = {axis: certified_gain(rig, channel) for axis, channel in machine.positions.items()}
    share = machine.sensor_share(rig.geometry["com_to_motor"].value, rig)
    outboard, motor, rests, grows = [], [], [], []
    for way in WAYS:
        pairs = [(f, d) for f, d in zip(found, done, strict=True) if f.forward is way]
        swings = [d.swing for _, d in pairs if d.swing is not None]
        tick = float(swings[0].t[1])
        loud = bounds.noise_of(rig, tuple(machine.positions.values()), 1 / tick)
        after = [slice(f.answers, None) for f, _ in pairs]
        beside, paths = ([p[:, a] for p, a in zip(of, after, strict=True)]
                         for of in ([s.orbit for s in swings], [s.motor for s in swings]))  # fmt: skip
        outboard.append(peak_of(beside, loud, tick))
        motor.append(peak_of(paths, loud * swings[0].spread, tick))
        grows.append(levered(paths, beside, share, tick))
        rests.append(np.mean([d.move.rest_orbit.mean(axis=1) for _, d in pairs], axis=0))
    still = [(float(np.hypot(*x)), x / max(float(np.hypot(*x)), 1e-300)) for x in rests]
    rest = Estimate.exact(float(np.mean([radius for radius, _ in still])), "m")
    at_outboard = _peak(f"outboard/{where}", outboard) + gained(
        ((p.radius, p.towards) for p in outboard), OUTBOARD, gains
    )
    return {
        "peak_outboard": at_outboard,
        "peak_motor": _peak(f"motor/{where}", motor)
        + gained(((p.radius, p.towards) for p in motor), at_motor(share), gains)
        + placed(rig, machine, float(np.mean(grows))),
        "excess": at_outboard - rest - gained(still, OUTBOARD, gains),
    }


def _peak(identity: str, ways: Sequence[Peak]) -> Estimate:
    """The mean of the peaks of both ways, less what noise adds to them, m."""
    by, off = (float(np.mean(values)) for values in ([p.raised.by for p in ways], [p.raised.off for p in ways]))
    left = within(f"raised/{identity}", "noise in a peak", off, "m")
    u = math.sqrt(sum(p.variance for p in ways)) / len(ways)
    steps = [len(p.without) for p in ways]
    found = _typed(
        f"peak/{identity}", "m", float(np.mean([p.radius for p in ways])), u, sum(steps) - len(ways), sum(steps)
    )
    return found + left - by


def _scattered(identity: str, unit: str, ways: Sequence[Sequence[float] | Array]) -> Estimate:
    """Mean over both ways, with what the steps of each differ by among themselves."""
    parts = [np.asarray(p, float) for p in ways]
    dof = sum(len(p) - 1 for p in parts)
    s = math.sqrt(sum(float(((p - p.mean()) ** 2).sum()) for p in parts) / dof)
    return _repeated(identity, unit, parts, s, dof)


def _repeated(identity: str, unit: str, ways: Sequence[Sequence[float] | Array], s: float, dof: int) -> Estimate:
    """Mean over both ways, each step of which has noise `s`."""
    parts = [np.asarray(p, float) for p in ways]
    u = s * math.sqrt(sum(1 / len(p) for p in parts)) / len(parts)
    return _typed(identity, unit, float(np.mean([p.mean() for p in parts])), u, dof, sum(map(len, parts)))


def _typed(identity: str, unit: str, value: float, u: float, dof: int, steps: int) -> Estimate:
    influence = Influence(id=f"scatter/{identity}", name="scatter of the repeats", u=u, unit=unit, kind="A",
                          distribution="normal", dof=float(dof), source=f"{steps} steps")  # fmt: skip
    return Estimate.of(value, influence)


def _read(identity: str, name: str, u: float, unit: str) -> Estimate:
    """Zero, with a standard uncertainty."""
    influence = Influence(id=identity, name=name, u=u, unit=unit, kind="B", distribution="normal")
    return Estimate.of(0.0, influence)
