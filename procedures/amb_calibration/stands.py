"""Where the shaft stands when a hanging is done again, and what force that makes.

A shaft that comes back to its angle comes from another side, and friction holds it a count or two of its encoder beside where
it stood; runout of the journals makes a force of that, by the slope of the fit's terms over the angle. A reading is
within half a count of where the shaft is, and not at random: friction lets it creep to where the reading changes. So two
readings differ by what the shaft turned within one count either way. A hand turns it as `shaft.hand_angle` says, each time
anew.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.recording.steps import Step
from procedures.amb_calibration import turns
from procedures.amb_calibration.fit import Fit
from procedures.amb_calibration.inputs import hand_rad
from procedures.amb_calibration.plan import Plan

Array = npt.NDArray[np.float64]
SAME_RAD = 1e-6  # readings nearer to each other are one count, in single precision


@dataclass(frozen=True)
class Turned:
    """From one hanging to another, rad: by how much as it was read, within which `count` of it at most, and its `u` beside."""

    rad: float
    count: float
    u: float


def turned(recording: Recording[Plan], first: Step, second: Step) -> Turned:
    """How the shaft stands in two hangings at one angle. One that nobody turns stays as it stands."""
    rig = recording.rig
    if recording.plan.angles == 1:
        return Turned(0.0, 0.0, 0.0)
    channel = rig.mark.angle if rig.mark is not None else ""
    if turns.by_hand(rig) or not channel:
        return Turned(0.0, 0.0, math.sqrt(2) * hand_rad(rig))
    one, two = (_read(step, channel) for step in (first, second))
    moved = math.remainder(_middle(two) - _middle(one), 2 * math.pi)
    return Turned(moved, _count(np.concatenate([one, two])), 0.0)


def slopes(f: Fit, design: Array, angle: int, place: int) -> Array:
    """Of the force (K,) N/rad that a hanging takes, by the orders that the terms have over evenly spaced angles; `design` as
    `fit.terms_of` has it."""
    count = f.terms.shape[1]
    orders = np.fft.rfft(f.terms, axis=1)
    n = np.arange(orders.shape[1]) * (
        2 * np.arange(orders.shape[1]) != count
    )  # half of the count has no slope that shows
    by_angle = np.fft.irfft(1j * n[None, :, None] * orders, count, axis=1)
    out: Array = np.einsum("bf,bf->b", design[:, angle, place], by_angle[:, angle])
    return out


def _read(step: Step, channel: str) -> Array:
    return np.asarray(step.read(channel)[channel], np.float64)


def _middle(angles: Array) -> float:
    return float(np.angle(np.exp(1j * angles).mean()))


def _count(angles: Array) -> float:
    """The smallest difference between readings: a count of an encoder, or more; of a reading without counts next to nothing."""
    apart = np.diff(np.unique(angles))
    apart = apart[apart > SAME_RAD]
    return float(apart.min()) if len(apart) else 0.0
