"""What a capture at the controller's full rate says of the angle better than telemetry does: where it is between the counts of
its encoder."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.angle_step.bounds import Swing
from procedures.angle_step.course import Course, course
from procedures.angle_step.edges import edges
from procedures.angle_step.settling import Settling
from procedures.angle_step.standing import Began, began
from procedures.angle_step.steps import Done

Array = npt.NDArray[np.float64]
ANSWERS = 0.5  # of its greatest: the torque current that answers a step
SWING_S = 5e-3  # a swing that ends near the band leaves it or does not: a jump of more
NEAR = 0.1  # of the rise: about a crossing, for the speed there


@dataclass(frozen=True)
class Fine:
    """Of one step, `forward` or back: rise and settling s, overshoot as a share; how long an amplifier cut its demand, s, where
    the law tells; the `course` of the angle from where it began, its `size` and the `band` of settling, rad; the tick at
    which the torque current `answers`; and at which edge the rotor stood before, `began`."""

    forward: bool
    rise: float
    settling: float
    overshoot: float
    saturated: float | None
    course: Course
    size: float
    band: float
    answers: int
    began: Began

    @property
    def longer(self) -> float:
        """By how much a start that is further on makes the rise longer, s/rad, if the loop is linear: what is left of it when
        the angle passes 10 % is 0.9, and 0.1 at 90 %."""
        t, y = self.course.t, self.course.y
        low, high = (self.course.crossing(share * self.size) for share in (0.1, 0.9))
        near = (high - low) * NEAR
        slow, fast = (float(np.interp(at + near, t, y) - np.interp(at - near, t, y)) / (2 * near) for at in (low, high))
        return 0.9 / slow - 0.1 / fast

    @property
    def settled(self) -> Settling:
        """By which its settling time is told."""
        answers = float(self.course.t[self.answers])
        return Settling(self.forward, self.course, self.size, self.band, answers, self.began.loose)


def fine(done: Done, swing: Swing, settling: float, band: float, count: float) -> Fine | None:
    """Of a captured step; None where the capture ends before the angle has settled, `settling` s after the answer by telemetry:
    its reference was written late, or its loop is slow. `band` rad of settling."""
    size, way = abs(done.move.step), math.copysign(1.0, done.move.step)
    start = done.target - done.move.step
    turns = 2 * np.pi * np.round((swing.angle[0] - start) / (2 * np.pi))
    found, answers = edges(swing.t, swing.angle, count).since(start + turns, way), answer(swing)
    angle = course(found, swing.t, way * (swing.angle - start - turns), way * swing.torque, answers)
    low, high = angle.crossing(0.1 * size), angle.crossing(0.9 * size)
    if not math.isfinite(high - low) or float(swing.t[answers]) + settling + SWING_S > swing.t[-1]:
        return None
    return Fine(
        forward=way > 0,
        rise=high - low,
        settling=angle.last_outside(size, band) - float(swing.t[answers]),
        overshoot=max(angle.top / size - 1, 0.0),
        saturated=swing.cut,
        course=angle, size=size, band=band, answers=answers, began=began(done, swing.angle[: answers + 1], count),
    )  # fmt: skip


def answer(swing: Swing) -> int:
    """The tick at which the torque current answers: an encoder that changes its count at rest makes it jump too, but less."""
    torque = np.abs(swing.torque)
    return int(np.argmax(torque > ANSWERS * torque.max()))
