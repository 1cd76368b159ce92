"""Where a rotor stands before and after its step, from the counts that telemetry tells.

A loop with an integrator does not leave the rotor within a count: it pushes until the count changes, and the rotor ends up
trembling at an edge, now on one side and now on the other. Then the edge says where it is. With a push of D a count (kp, by
what the torque current does) it is pushed back on one side by as much as the time on the other makes good: by D s/T, where it
stays for T between visits of s there, and goes off by a parabola meanwhile, D s T/12 in the mean. A stay of 0.1 s is 0.03 of a
count. The share of the time on the rarer side is what is left of the push, in counts; noise of a swing leaves the integrator
0.008 of a count off from step to step, and it is within that that chance says whether the rotor goes on to the next edge. Where
it came to this edge not long ago, it might as well have come later, and was in the midst of a count until then.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.angle_step.response import TAIL_S
from procedures.angle_step.steps import Done

Array = npt.NDArray[np.float64]
EACH = (
    0.008  # of a count: what noise moves a turning point by from step to step, and with it what the integrator learns
)
VERGE = 2 * EACH  # of the time on one side, which is what is left of the push: it may go on to the next edge or not
BEFORE = 1.5  # of the time that is looked at: within so long it may have come from another edge
TREMBLES = 0.01  # of a count: what a kick of the derivative moves it off the edge before the controller hears of it


@dataclass(frozen=True)
class Stands:
    """How far the angle is off its reference, rad, within `half` rad."""

    error: float
    half: float


@dataclass(frozen=True)
class Began:
    """At which `edge` the rotor stood before its step, counts off its reference then, in the direction of the step; NaN where
    none tells. `loose`: it might have stood at the next one."""

    edge: float
    loose: bool


def stands(done: Done, count: float, push: float) -> Stands:
    """After a step; `count` rad of the encoder, `push` rad/s^2 of a count (NaN: not known)."""
    move = done.move
    tail = move.t > move.t[-1] - TAIL_S
    angle = move.angle[tail] + (done.target - move.step)
    counts = np.rint(angle / count)
    if np.ptp(counts) != 1 or not math.isfinite(push):  # within one count, or it still moves
        return Stands(float(angle.mean()) - done.target, count / 2)
    ends = np.flatnonzero(np.diff(counts, prepend=math.nan, append=math.nan) != 0)
    upper = counts[ends[:-1]] > counts.min()
    share = float((counts > counts.min()).mean())
    stays, whole = np.diff(ends) * (move.t[1] - move.t[0]), float(np.ptp(move.t[tail]))
    above, below = (
        push * float(stays[~of].mean()) * float((stays[of] ** 2).sum()) / 12 / whole for of in (upper, ~upper)
    )
    edge = (float(counts.min()) + 0.5) * count - done.target
    half = (above + below) / 2 + TREMBLES * count
    before = np.rint((move.angle[move.t > move.t[-1] - BEFORE * TAIL_S] + (done.target - move.step)) / count)
    came = float(before.max() + before.min()) / 2 if np.ptp(before) > 1 else float(before[0])
    late = int(np.argmax((before != came) & np.isin(before, counts))) - len(before) + len(counts)
    if np.ptp(before) > 1 or late >= 0:
        return Stands(edge + (came * count - done.target - edge) * max(late, 0) / len(counts), count / 2)
    if half > count / 2 or min(share, 1 - share) < VERGE:
        return Stands(edge, count / 2)
    return Stands(edge + (above - below) / 2, half)


def began(done: Done, reading: Array, count: float) -> Began:
    """Before a step, from the telemetry of the standstill and the `reading` (n,) rad of the capture from then on to the answer,
    turns of which do not matter."""
    start, way = done.target - done.move.step, math.copysign(1.0, done.move.step)
    rest = np.rint((done.move.rest_angle + start) / count)
    near = np.rint((reading - 2 * np.pi * np.round((reading[0] - start) / (2 * np.pi))) / count)
    seen = np.concatenate([rest, near])
    at = np.flatnonzero(np.diff(seen))
    if not len(at):
        return Began(math.nan, True)
    edge = float(seen[at[-1]] + seen[at[-1] + 1]) / 2
    share = float((rest > edge).mean()) if len(rest) else 0.0
    return Began(way * (edge - start / count), bool(np.ptp(seen) > 1 or min(share, 1 - share) < VERGE))
