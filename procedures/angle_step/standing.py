"""Where a rotor stands after its step, from the counts that telemetry tells.

A loop with an integrator does not leave the rotor within a count: it pushes until the count changes, and the rotor ends up
trembling at an edge, now on one side and now on the other. Then the edge says where it is. On the side of one count it is
pushed back as much as the share of the time on the other side makes good: with a push of D a count (kp, by what the torque
current does), D (1 - f) on the upper side, where it is for a share f, and D f on the lower. For a time T away from the edge it
goes off by a parabola, a T^2/12 in the mean; it may have been back in between where telemetry did not see it. When it goes on
to the next edge is chance: where it is on one side all but always, no push is left that keeps it, and where it came to this
edge not long ago, it might as well have come later.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from procedures.angle_step.response import TAIL_S
from procedures.angle_step.steps import Done

VERGE = 0.05  # of the time on one side: it may go on to the next edge or not
BEFORE = 1.5  # of the time that is looked at: within so long it may have come from another edge
TREMBLES = 0.01  # of a count: what a kick of the derivative moves it off the edge before the controller hears of it


@dataclass(frozen=True)
class Stands:
    """How far the angle is off its reference, rad, within `half` rad."""

    error: float
    half: float


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
    off = push * (np.diff(ends) * (move.t[1] - move.t[0])) ** 3 / 12 / float(np.ptp(move.t[tail]))
    above, below = float(off[upper].sum()) * (1 - share), float(off[~upper].sum()) * share
    edge = (float(counts.min()) + 0.5) * count - done.target
    half = (above + below) / 2 + TREMBLES * count
    before = np.rint((move.angle[move.t > move.t[-1] - BEFORE * TAIL_S] + (done.target - move.step)) / count)
    if half > count / 2 or np.ptp(before) > 1 or min(share, 1 - share) < VERGE:
        return Stands(edge, count / 2)
    return Stands(edge + (above - below) / 2, half)
