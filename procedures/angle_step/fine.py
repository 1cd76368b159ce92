"""What a capture at the controller's full rate says of the angle better than telemetry does: where it is between the counts of
its encoder."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.angle_step.bounds import Swing
from procedures.angle_step.edges import Edges, edges
from procedures.angle_step.steps import Done

Array = npt.NDArray[np.float64]
ANSWERS = 0.5  # of its greatest: the torque current that answers a step
BETWEEN = 0.02  # of a count: rms of what a turning point between two edges is off (drawn swings)
FURTHER = 0.3  # of a count: within so much a swing may leave the band in one step and not in the next
SWING_S = 5e-3  # a swing that ends near the band leaves it or does not: a jump of more


@dataclass(frozen=True)
class Fine:
    """Of one step, `forward` or back: rise and settling s, overshoot as a share; `slopes` rad/s at 10 and 90 %; how long an
    amplifier cut its demand, s, where the law tells; its `edges` from where it began, its `size` and the `band` of settling,
    rad; and the tick at which the torque current `answers`."""

    forward: bool
    rise: float
    settling: float
    overshoot: float
    slopes: tuple[float, float]
    saturated: float | None
    edges: Edges
    size: float
    band: float
    answers: int

    def settling_off(self, unsure: float, most: float) -> tuple[float, float]:
        """What an angle that is `unsure` by so much, rad, does to the settling time, s; and the jump of a swing that ends
        within `most` rad of the band, and may leave it or not."""
        last = self.edges.last_outside(self.size, self.band)
        near, far = ([abs(self.edges.last_outside(self.size, self.band + k * by) - last) for k in (-1, 1)]
                     for by in (unsure, most))  # fmt: skip
        smooth = [s for s in near if s < SWING_S]
        return max(smooth, default=0.0), max((s for s in far if s >= SWING_S), default=0.0)


def fine(done: Done, swing: Swing, settling: float, band: float, count: float) -> Fine | None:
    """Of a captured step; None where the capture ends before the angle has settled, `settling` s after the answer by telemetry:
    its reference was written late, or its loop is slow. `band` rad of settling."""
    size, way = abs(done.move.step), math.copysign(1.0, done.move.step)
    start = done.target - done.move.step
    turns = 2 * np.pi * np.round((swing.angle[0] - start) / (2 * np.pi))
    found = edges(swing.t, swing.angle, count).since(start + turns, way)
    low, high = found.crossing(0.1 * size), found.crossing(0.9 * size)
    answers = answer(swing)
    if not math.isfinite(high) or float(swing.t[answers]) + settling + SWING_S > swing.t[-1]:
        return None
    tops = [y for _, y in found.turning()]
    return Fine(
        forward=way > 0,
        rise=high - low,
        settling=found.last_outside(size, band) - float(swing.t[answers]),
        overshoot=max(max(tops, default=0.0) / size - 1, 0.0),
        slopes=(_slope(found, low), _slope(found, high)),
        saturated=swing.cut,
        edges=found, size=size, band=band, answers=answers,
    )  # fmt: skip


def answer(swing: Swing) -> int:
    """The tick at which the torque current answers: an encoder that changes its count at rest makes it jump too, but less."""
    torque = np.abs(swing.torque)
    return int(np.argmax(torque > ANSWERS * torque.max()))


def _slope(found: Edges, at: float) -> float:
    """Speed of the angle at a time, rad/s, by the edges about it."""
    k = int(np.clip(np.searchsorted(found.t, at), 1, len(found.t) - 1))
    return max(float((found.y[k] - found.y[k - 1]) / max(found.t[k] - found.t[k - 1], 1e-9)), 1e-6)
