"""When the angle settles by telemetry alone, where nothing was captured.

A swing that ends within a count of its band leaves it or does not: half a swing later or earlier, and the count that telemetry
tells does not say which. The swing between two edges does: its torque was measured, as means from one sample to the next, and
course.py makes of it what the angle did meanwhile. That is good from where the angle first passes its target, for what the
kick of a step does within a sample no mean tells.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bench.uncertainty import Estimate
from procedures.angle_step.budget import within
from procedures.angle_step.course import course
from procedures.angle_step.edges import edges
from procedures.angle_step.settling import SURE, Settling, settled, split
from procedures.angle_step.steps import Done
from procedures.angle_step.trend import noise

STIFF = 0.4  # of the spread that samples give: swings have few edges, which are known better than half a sample
BETWEEN = 0.03  # of a count: what a turning point is off in all steps of one way
EACH = 0.05  # of a count: from step to step


def settling_time(where: str, done: Sequence[Done], band: float, count: float) -> Estimate:
    """The mean over the steps, s, from when the torque current answered, which was within the first sample. `band` rad of
    settling, `count` rad of the encoder."""
    period = float(done[0].move.t[1])
    found = [_swung(d, band, count) for d in done]
    tops = split(found, [s.course.top for s in found])
    s, dof = noise(tops) if min(map(len, tops)) > 1 else (count / math.sqrt(3), SURE)
    mean = settled(where, found, (max(s, EACH * count), dof), BETWEEN, count)
    return mean - period / 2 + within(f"sampling/{where}", "sampling", period / 2, "s")


def _swung(done: Done, band: float, count: float) -> Settling:
    move = done.move
    size, way, start = abs(move.step), math.copysign(1.0, move.step), done.target - move.step
    half = (move.t[1] - move.t[0]) / 2
    torque = np.interp(move.t + half, move.t, move.torque[0].mean(axis=0))  # a mean belongs half a sample earlier
    y = way * move.angle
    found = edges(move.t, move.angle + start, count).since(start, way)
    return Settling(way > 0, course(found, move.t, y, way * torque, int(np.argmax(y > size)), STIFF), size, band, 0.0)
