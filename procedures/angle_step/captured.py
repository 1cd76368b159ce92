"""From captured steps to estimates: what the steps that were made did, by what their captures can tell.

The response of the angle is that of the steps that were made, as a mean of both ways: where each begins within its encoder's
count, and how far the angle's integrator has learned by then, makes steps differ, and is no error of what was read. What was
read is as good as edges and ticks. The shaft's path has noise, and its uncertainty what the steps of one way differ by.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.angle_step import bounds, steps
from procedures.angle_step.budget import OUTBOARD, at_motor, gained, within
from procedures.angle_step.fine import BETWEEN, FURTHER, Fine, fine
from procedures.angle_step.paths import Peak, peak_of
from procedures.angle_step.response import Response
from procedures.angle_step.steps import Case, Done
from procedures.servomotor.conventions import conventions
from procedures.shared.certificates import certified_gain

Array = npt.NDArray[np.float64]
WAYS = (True, False)  # to the angle, and back
CROSSING = math.sqrt(2 / 3 / 12)  # of a tick: a time between two edges has 2/3 of the variance of one within a tick


def by_case(
    moves: Sequence[Done],
    responses: Mapping[Case, Sequence[Response]],
    rig: RigFile,
    bands: Mapping[Case, float],
    count: float,
) -> tuple[dict[Case, dict[str, Estimate]], dict[Case, int]]:
    """What captures add and what they say better, of the cases whose captures hold their steps; and how many are too short of
    each other. `bands` rad of settling, `count` rad of the encoder."""
    whole: dict[Case, list[Fine]] = {}
    short: dict[Case, int] = {}
    done = {case: [d for d in of if d.swing is not None] for case, of in steps.by_case(list(moves)).items()}
    for case, of in done.items():
        found = [fine(d, d.swing, r.settling, bands[case], count)
                 for d, r in zip(of, responses[case], strict=False) if d.swing is not None]  # fmt: skip
        if any(f is None for f in found):
            short[case] = sum(f is None for f in found)
        elif found:
            whole[case] = [f for f in found if f is not None]
    return {c: _estimates(c, found, done[c], responses[c], rig, count) for c, found in whole.items()}, short


def _estimates(
    case: Case, found: Sequence[Fine], done: Sequence[Done], r: Sequence[Response], rig: RigFile, count: float
) -> dict[str, Estimate]:  # fmt: skip
    where, ways = case.where, [f.forward for f in found]
    swings = [d.swing for d in done if d.swing is not None]
    tick = float(swings[0].t[1])
    slope = 1 / math.sqrt(np.mean([1 / f.slopes[0] ** 2 + 1 / f.slopes[1] ** 2 for f in found]))
    between = _read(f"edges/{where}", "encoder between its counts", BETWEEN * count, "rad")
    crossings = _read(f"ticks/{where}", "sampling", tick * CROSSING, "s")
    late = np.mean([f.settling_off(BETWEEN * count, FURTHER * count) for f in found], axis=0)
    standing = within(f"standing/{where}", "where it stands within a count", count / 2, "rad")

    def mean(values: Sequence[float], unit: str) -> Estimate:
        parts = [[v for v, w in zip(values, ways, strict=True) if w is way] for way in WAYS]
        return Estimate.exact(float(np.mean([np.mean(p) for p in parts])), unit)

    out = {
        "rise_time": mean([f.rise for f in found], "s") + crossings * math.sqrt(2) + between * (1 / slope),
        "overshoot": mean([f.overshoot for f in found], "1") + between * (1 / case.size),
        "settling_time": mean([f.settling for f in found], "s") + crossings
        + _read(f"edges/settling/{where}", "encoder between its counts", float(late[0]), "s")
        + within(f"edges/swings/{where}", "whether a swing leaves the band", float(late[1]), "s"),
        "final_error": mean([x.final_error for x in r], "rad") + standing,
        **_peaks(where, found, done, rig),
        **bounds.estimates(where, swings, rig, case.allocation == "priority"),
    }  # fmt: skip
    cut = [f.saturated for f in found if f.saturated is not None]
    if len(cut) == len(found):
        out["saturated"] = _scattered(f"saturated/{where}", "s", [cut[k::2] for k in (0, 1)]) + within(
            f"ticks/cut/{where}", "sampling", tick / 2, "s"
        )
    return out


def _peaks(where: str, found: Sequence[Fine], done: Sequence[Done], rig: RigFile) -> dict[str, Estimate]:
    """How far the mean path of each way goes, as a mean over both."""
    machine = conventions(rig)
    gains = {axis: certified_gain(rig, channel) for axis, channel in machine.positions.items()}
    share = machine.sensor_share(rig.geometry["com_to_motor"].value, rig)
    outboard, motor, rests = [], [], []
    for way in WAYS:
        pairs = [(f, d) for f, d in zip(found, done, strict=True) if f.forward is way]
        swings = [d.swing for _, d in pairs if d.swing is not None]
        noise = bounds.noise_of(rig, tuple(machine.positions.values()), 1 / float(swings[0].t[1]))
        after = [slice(f.answers, None) for f, _ in pairs]
        outboard.append(peak_of([s.orbit[:, a] for s, a in zip(swings, after, strict=True)], noise))
        motor.append(peak_of([s.motor[:, a] for s, a in zip(swings, after, strict=True)], noise * swings[0].spread))
        rests.append(np.mean([d.move.rest_orbit.mean(axis=1) for _, d in pairs], axis=0))
    still = [(float(np.hypot(*x)), x / max(float(np.hypot(*x)), 1e-300)) for x in rests]
    rest = Estimate.exact(float(np.mean([radius for radius, _ in still])), "m")
    at_outboard = _peak(f"outboard/{where}", outboard) + gained(
        ((p.radius, p.towards) for p in outboard), OUTBOARD, gains
    )
    return {
        "peak_outboard": at_outboard,
        "peak_motor": _peak(f"motor/{where}", motor)
        + gained(((p.radius, p.towards) for p in motor), at_motor(share), gains),
        "excess": at_outboard - rest - gained(still, OUTBOARD, gains),
    }


def _peak(identity: str, ways: Sequence[Peak]) -> Estimate:
    """The mean of the peaks of both ways, less what noise adds to them, m."""
    by, off = (float(np.mean(values)) for values in ([p.raised.by for p in ways], [p.raised.off for p in ways]))
    noise = within(f"raised/{identity}", "noise in a peak", off, "m")
    return _scattered(f"peak/{identity}", "m", [p.each for p in ways]) + noise - by


def _scattered(identity: str, unit: str, ways: Sequence[Sequence[float] | Array]) -> Estimate:
    """Mean over both ways, with what the steps of each differ by among themselves."""
    parts = [np.asarray(p, float) for p in ways]
    dof = sum(len(p) - 1 for p in parts)
    s = math.sqrt(sum(float(((p - p.mean()) ** 2).sum()) for p in parts) / dof)
    u = s * math.sqrt(sum(1 / len(p) for p in parts)) / len(parts)
    influence = Influence(id=f"scatter/{identity}", name="scatter of the repeats", u=u, unit=unit, kind="A",
                          distribution="normal", dof=float(dof), source=f"{dof + len(parts)} steps")  # fmt: skip
    return Estimate.of(float(np.mean([p.mean() for p in parts])), influence)


def _read(identity: str, name: str, u: float, unit: str) -> Estimate:
    """Zero, with a standard uncertainty of its own for either way of the mean."""
    influence = Influence(id=identity, name=name, u=u / math.sqrt(2), unit=unit, kind="B", distribution="normal")
    return Estimate.of(0.0, influence)
