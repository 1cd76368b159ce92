"""What a capture at the controller's full rate says of a step better than telemetry does: the angle between the counts of its
encoder, and peaks that are over within a few milliseconds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.angle_step.bounds import Swing
from procedures.angle_step.edges import Edges, edges
from procedures.angle_step.steps import Done

Array = npt.NDArray[np.float64]
SMOOTH = 21  # ticks of the parabola that a peak is read from: keeps 99 % of one that lasts 4 ms, noise falls to a third
WIDER = (41, 61, 121, 241, 481)  # ticks of the curves that drawn noise may be put on; of the first only to compare
KEEPS = 2.0  # times its noise: what a curve that keeps a peak's height may differ there from that of 61 ticks
DRAWS = 16  # of noise
ANSWERS = 0.5  # of its greatest: the torque current that answers a step
BETWEEN = 0.05  # of a count: what a turning point between two edges may be off (0.02 rms of drawn swings)
TOUCHES = 0.5  # of a count: a swing that ends so near the band leaves it or does not,
SWING_S = 5e-3  # which is a jump of more


@dataclass(frozen=True)
class Raised:
    """`by` how much noise raises a peak, m, and how far `off` that may be, m: what a curve that is smoothed less says."""

    by: float
    off: float


@dataclass(frozen=True)
class Fine:
    """Of one step, `forward` or back: rise and settling s (`settling_off` s, what a twentieth of a count in the band does to
    it), overshoot as a share; peaks off the sensors' zero at the outboard sensor and at the motor, m, with their directions,
    and by how much noise has `raised` each; `slopes` rad/s at 10 and 90 %; `saturated` s."""

    forward: bool
    rise: float
    settling: float
    settling_off: float
    overshoot: float
    peak: float
    peak_motor: float
    towards: Array
    towards_motor: Array
    raised: Raised
    motor_raised: Raised
    slopes: tuple[float, float]
    saturated: float


def fine(done: Done, swing: Swing, settling: float, band: float, count: float, noise: float) -> Fine | None:
    """Of a captured step; None where the capture ends before the angle has settled, `settling` s after the answer by telemetry:
    its reference was written late, or its loop is slow. `band` rad of settling, `noise` m of a reading."""
    size, way = abs(done.move.step), math.copysign(1.0, done.move.step)
    start = done.target - done.move.step
    turns = 2 * np.pi * np.round((swing.angle[0] - start) / (2 * np.pi))
    found = edges(swing.t, swing.angle, count).since(start + turns, way)
    low, high = found.crossing(0.1 * size), found.crossing(0.9 * size)
    if not math.isfinite(high) or _answer(swing) + settling + SWING_S > swing.t[-1]:
        return None
    tops = [y for _, y in found.turning()]
    settled, *others = (found.last_outside(size, band + k * count) for k in (0.0, -BETWEEN, BETWEEN, -TOUCHES, TOUCHES))
    near, touching = others[:2], [s for s in others[2:] if abs(s - settled) > SWING_S]
    peak, towards, raised = _peak(swing.orbit, noise)
    motor, towards_motor, motor_raised = _peak(swing.motor, noise * swing.spread)
    return Fine(
        forward=way > 0,
        rise=high - low,
        settling=settled - _answer(swing),
        settling_off=max(abs(s - settled) for s in (*near, *touching)),
        overshoot=max(max(tops, default=0.0) / size - 1, 0.0),
        peak=peak, peak_motor=motor, towards=towards, towards_motor=towards_motor, raised=raised,
        motor_raised=motor_raised,
        slopes=(_slope(found, low), _slope(found, high)),
        saturated=swing.cut,
    )  # fmt: skip


def _answer(swing: Swing) -> float:
    """When the torque current answers, s: an encoder that changes its count at rest makes it jump too, but less."""
    torque = np.abs(swing.vectors[:, 0].mean(axis=0))
    return float(swing.t[int(np.argmax(torque > ANSWERS * torque.max()))])


def _smoothed(x: Array, ticks: int = SMOOTH) -> Array:
    """(..., n): each sample from a parabola through its neighbours (Savitzky and Golay)."""
    from scipy import signal

    out: Array = signal.savgol_filter(x, ticks, 2, axis=-1)
    return out


def _peak(orbit: Array, noise: float) -> tuple[float, Array, Raised]:
    """Greatest distance off centre, m, its direction (2,), and by how much noise raises it: as much as drawn noise
    raises the peak of a smoother curve. Noise on top of what was read would say too much, for where a peak is round, the first
    noise raises it less than what follows. Each draw is taken with both signs: their mean is nothing at any tick."""
    smooth = _smoothed(orbit)
    radius = np.hypot(*smooth)
    k = int(np.argmax(radius))
    half = _smoothed(np.random.default_rng(0).normal(0.0, noise, (DRAWS // 2, *orbit.shape)))
    drawn = np.concatenate([half, -half])
    by, other = (_raised(curve, drawn) for curve in _beneath(orbit, noise))
    return float(radius[k]), smooth[:, k] / max(float(radius[k]), 1e-300), Raised(by, abs(by - other))


def _beneath(orbit: Array, noise: float) -> tuple[Array, Array]:
    """The smoothest curve that keeps the height of the peak, for its own noise is taken for the peak's; and the one before."""
    before, curve = (_smoothed(orbit, ticks) for ticks in WIDER[:2])
    loud = (
        KEEPS * 1.5 * noise / math.sqrt(WIDER[1])
    )  # the middle of a parabola of n ticks has 9/(4 n) of their variance
    radius = np.hypot(*curve)
    for ticks in WIDER[2:]:
        wider = _smoothed(orbit, ticks)
        size = np.hypot(*wider)
        k = int(np.argmax(size))
        if abs(radius[k] - size[k]) > loud:
            break
        before, curve = curve, wider
    return curve, before


def _raised(curve: Array, drawn: Array) -> float:
    """By how much noise `drawn` (DRAWS, 2, n) m raises the greatest distance of a curve (2, n) m off centre, in the mean."""
    again = curve + drawn
    return float(np.hypot(again[:, 0], again[:, 1]).max(axis=1).mean() - np.hypot(*curve).max())


def _slope(found: Edges, at: float) -> float:
    """Speed of the angle at a time, rad/s, by the edges about it."""
    k = int(np.clip(np.searchsorted(found.t, at), 1, len(found.t) - 1))
    return max(float((found.y[k] - found.y[k - 1]) / max(found.t[k] - found.t[k - 1], 1e-9)), 1e-6)
