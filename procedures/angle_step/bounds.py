"""Currents at the controller's full rate during a step: how long an amplifier cuts what the law asks for, whether torque stays
within what force leaves, and segments within I_s.

Of a motor whose segments carry vectors, q along the field and d across it, force asks i_x, i_y and T (7.18), put right, leaves

    |i_theta| <= max(0, sqrt(I_s^2 - i_x^2) - |i_y|)

after i_x, i_y have been scaled into the circle I_s. Means over a millisecond would not do: a bound that steps reads as an
ampere of excess. The capture begins just before the reference is written and lasts as long as the currents swing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE, resolved
from bench.uncertainty import Estimate
from procedures.angle_step.budget import within
from procedures.servomotor.conventions import conventions, displacement
from procedures.servomotor.parameters import stated

Array = npt.NDArray[np.float64]
ASKED = ("across", "along", "torque")
SHARE = "share"
POSITIONS = ("xi", "yi", "xo", "yo")
CAPTURED_S = 0.4
ROUNDING_A = 10 * 2**-23  # of what the law tells, single precision: no cut is seen in less


@dataclass(frozen=True)
class Swing:
    """A captured step: `t` (n,) s, `asked` i_x, i_y, i_theta of the law, each (n,) A, with the share of the torque that the
    segments along have where amplitudes share it, or nothing where it does not tell them; `vectors` (k, c, n) A: q and d of
    each segment as their sensors read, or its amplitude; `limit` I_s, A; `angle` (n,) rad as the encoder tells it; `orbit` and
    `motor` (2, n) m off the sensors' zero, at the outboard sensor and at the motor; `spread`: the latter's noise over that of
    one sensor."""

    t: Array
    asked: Mapping[str, Array]
    vectors: Array
    limit: float
    angle: Array
    orbit: Array
    motor: Array
    spread: float

    @property
    def whole(self) -> bool:
        """Whether segments are told as vectors, q and d."""
        return bool(self.vectors.shape[1] == 2)

    @property
    def bound(self) -> Array:
        """What (i_x, i_y) leave to the torque current, (n,) A."""
        return bound(self.asked["across"], self.asked["along"], self.limit)

    @property
    def torque(self) -> Array:
        """The torque current (n,) A, as its sensors read: the mean along the field."""
        out: Array = self.vectors[:, 0].mean(axis=0)
        return out

    @property
    def cut(self) -> float | None:
        """How long the law asks a segment for more than its limit, s, which its amplifier cuts; None where it does not tell."""
        if not self.asked:
            return None
        return float((self._most > self.limit + 3 * ROUNDING_A).sum() * self.t[1])

    @property
    def _most(self) -> Array:
        """The greatest amplitude that the law asks a segment for, (n,) A: q is i_theta +- i_y, d is i_x, T (7.12); or by T
        (6.19) 2 lambda i_theta +- i_y and 2 (1 - lambda) i_theta +- i_x."""
        x, y, torque = (np.abs(self.asked[key]) for key in ASKED)
        if self.whole:
            return np.asarray(np.hypot(torque + y, x))
        share = self.asked[SHARE]
        return np.asarray(np.maximum(2 * share * torque + y, 2 * (1 - share) * torque + x))

    @property
    def excess(self) -> float:
        """Greatest torque current beyond its bound, A: 0 where it was reached, negative where it never was."""
        return float((np.abs(self.asked["torque"]) - self.bound).max())

    @property
    def rounding(self) -> float:
        """What rounding of i_x, i_y, i_theta to single precision may add to the excess where it is greatest, A."""
        k = int(np.argmax(np.abs(self.asked["torque"]) - self.bound))
        x, y, torque = (float(self.asked[key][k]) for key in ASKED)
        steep = min(abs(x) / max(math.sqrt(max(self.limit**2 - x**2, 0.0)), 1e-12), 1e3)  # of the bound, by i_x
        halves = [0.5 * float(np.spacing(np.float32(abs(value)))) for value in (x, y, torque)]
        return steep * halves[0] + halves[1] + halves[2]


def bound(i_x: Array, i_y: Array, limit: float) -> Array:
    """T (7.18), put right: A."""
    scale = np.minimum(1.0, limit / np.maximum(np.hypot(i_x, i_y), 1e-12))
    x, y = i_x * scale, i_y * scale
    out: Array = np.maximum(0.0, np.sqrt(np.maximum(0.0, limit**2 - x**2)) - np.abs(y))
    return out


def captured(rig: RigFile) -> tuple[str, ...]:
    """What is captured of a step: segments, positions and angle, with what the law asks for where it tells that; nothing where
    the controller does not record them."""
    machine = conventions(rig)
    names = (*machine.segments, *told(rig).values(), *machine.positions_of(*POSITIONS), *resolved(rig, [ANGLE]))
    known = () if rig.capture is None else tuple(rig.capture.channels)
    return names if set(names) <= set(known) else ()


def bounded(rig: RigFile) -> bool:
    """Whether segments carry vectors, and what the law asks for is recorded: then torque shows its bound."""
    return conventions(rig).components == 2 and bool(told(rig))


def told(rig: RigFile) -> dict[str, str]:
    """Channels of what the law asks for by what they are; nothing where one is not recorded."""
    machine = conventions(rig)
    keys = ASKED if machine.components == 2 else (*ASKED, SHARE)
    known = () if rig.capture is None else tuple(rig.capture.channels)
    return {key: machine.asked[key] for key in keys} if all(machine.asked.get(key) in known for key in keys) else {}


def read_swing(recording: Recording[Any], number: object) -> Swing | None:
    """The capture of a move by its number; None where there is none, and where it has no number: nothing was captured when
    it was recorded.

    Raises:
        AnalysisError: it is missing.
    """
    names = captured(recording.rig)
    if not names or number is None:
        return None
    found = recording.captures(number=number)
    if not found:
        raise AnalysisError(f"move {number}: found no capture (was the run stopped early?)")
    machine, data, rig = conventions(recording.rig), found[0].arrays(*names), recording.rig
    inboard, outboard = (np.array([data[c] for c in machine.positions_of(f"x{b}", f"y{b}")]) for b in "io")
    share = machine.sensor_share(rig.geometry["com_to_motor"].value, rig)
    return Swing(
        np.arange(len(data[names[0]])) / found[0].rate_hz,
        {key: data[channel] for key, channel in told(rig).items()},
        np.array([[data[c] for c in pair] for pair in machine.vectors]),
        stated(rig, "motor.segment_limit").default,
        np.unwrap(data[resolved(rig, [ANGLE])[0]]),
        outboard,
        displacement(inboard, outboard, share),
        math.hypot(share, 1 - share),
    )


def estimates(where: str, swings: Sequence[Swing], rig: RigFile, at_bound: bool) -> dict[str, Estimate]:
    """`bound_excess`, A, where the torque current is held `at_bound`: a mean over the steps of a case; nothing of a motor whose
    segments carry no vectors."""
    if not (bounded(rig) and at_bound):
        return {}
    half = (
        float(np.mean([s.rounding for s in swings])) / 2
    )  # the greatest of many lies in the upper half of what rounding does
    rounding = within(f"rounding/{where}", "rounding of what the law tells", half, "A")
    return {"bound_excess": Estimate.exact(float(np.mean([s.excess for s in swings])) - half, "A") + rounding}


def noise_of(rig: RigFile, channels: Sequence[str], rate_hz: float) -> float:
    """The largest of single readings of channels: the rig file has that of a sample of the telemetry, a mean of as many."""
    period = rig.messages[rig.binding.telemetry[0]].period_s or 1 / rate_hz
    stated = [rig.channels[c].noise or 0.0 for c in channels]
    return max(stated) * math.sqrt(max(period * rate_hz, 1.0))
