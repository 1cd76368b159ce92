"""Balance of torques of a motor that gives all the torque its law leaves: arrays and numbers in, numbers out.

    alpha_tau cos(M gamma_0t) i_theta = B w + T_c

The law puts force first, T (6.19): of a limit I_s of each segment it leaves for torque

    lambda_op, T (6.24):  i_theta = I_s - (|i_x| + |i_y|)/2
    lambda = 1/2:         i_theta = I_s - max(|i_x|, |i_y|)

at every instant, so that means are of |i|, and not |mean of i|: runout and noise make currents that cost torque.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.maximum_speed.plan import HALF, SHARINGS

Array = npt.NDArray[np.float64]
ORDERS = (1, 2, 3, 4)  # of the speed's ripple: the runout's
FEWEST_TURNS = 2


def bound(limit: float, i_x: Array, i_y: Array, sharing: str) -> Array:
    """Torque current (n,) A that a limit in A leaves beside i_x, i_y (n,) A."""
    x, y = np.minimum(np.abs(i_x), limit), np.minimum(np.abs(i_y), limit)
    out: Array = limit - (np.maximum(x, y) if sharing == HALF else (x + y) / 2)
    return out


def share(limit: float, i_x: Array, i_y: Array, sharing: str) -> Array:
    """lambda (n,): a half, or T (6.24), (I_s - |i_y|)/(2 I_s - |i_x| - |i_y|)."""
    x, y = np.minimum(np.abs(i_x), limit), np.minimum(np.abs(i_y), limit)
    left = 2 * limit - x - y
    if sharing == HALF:
        return np.full(len(x), 0.5)
    return np.where(left > 0, (limit - y) / np.where(left > 0, left, 1.0), 0.5)


@dataclass(frozen=True)
class Turning:
    """Mean `speed` over whole turns, which the first `samples` are, rad/s with its sign; `seconds` that they last."""

    speed: float
    turns: int
    samples: int
    seconds: float


def turning(t: Array, angle: Array) -> Turning:
    """Of angles (n,) rad within a turn at times (n,) s.

    A whole number of turns, so that what the encoder says wrongly over a turn is left out, and what runout does to the speed.
    Over them theta = theta_0 + w t + sum a_n cos(n theta) + b_n sin(n theta) is fitted to every sample: w takes part in the
    counts of all of them, and not of the two at the ends alone.

    Raises:
        AnalysisError: it turns less than twice.
    """
    unwrapped = np.unwrap(angle)
    way = 1.0 if unwrapped[-1] >= unwrapped[0] else -1.0
    turned = way * (unwrapped - unwrapped[0])
    turns = int(turned[-1] / (2 * math.pi))
    if turns < FEWEST_TURNS:
        raise AnalysisError(
            f"window: the rotor turns {turned[-1] / (2 * math.pi):.2f} times; expected {FEWEST_TURNS} or more. "
            "Give a longer average_s"
        )
    last = int(np.searchsorted(turned, 2 * math.pi * turns))
    x, time = unwrapped[:last], t[:last] - t[0]
    speed = float(np.linalg.lstsq(np.column_stack([_orders(x), time]), x, rcond=None)[0][-1])
    return Turning(speed, turns, last, float(time[-1]))


def swings(t: Array, angle: Array) -> Array:
    """What the speed swings by with cos and sin of orders 1 to 4 of the rotor's angle, (8,) rad/s: of unwrapped angles (n,) rad
    of whole turns at times (n,) s.

    It is taken from the rates between samples: noise makes the angle wander, which fills all orders of a short window, and the
    speed does not. The counts of the encoder beat with the samples: where nearly a whole number of them passes from one sample
    to the next, their rounding goes round slowly and looks like an order. At 1 kHz that is so near every 1.53 rad/s, at 10 kHz
    near every 15.3.
    """
    rates, between = np.diff(angle) / np.diff(t), (angle[1:] + angle[:-1]) / 2
    return np.asarray(np.linalg.lstsq(_orders(between), rates, rcond=None)[0][1:], dtype=np.float64)


def _orders(angle: Array) -> Array:
    """1, and cos and sin of each order, (n, 9)."""
    return np.column_stack([np.ones_like(angle), *(wave(n * angle) for n in ORDERS for wave in (np.cos, np.sin))])


@dataclass(frozen=True)
class Ripple:
    """Rms of the orders in several windows, rad/s: its `size`, and how far each window's own lies from it, `off` (n,)."""

    size: float
    off: Array


def ripple(swings: Array) -> Ripple:
    """Of the swings (n, 8) of n windows, two or more. They turn with the rotor, so that their mean is a vector's; by its square
    it is too long by what the windows scatter, which is taken off: noise moves the speed by more than runout does with (6.24).
    """
    mean, scattered = swings.mean(axis=0), float(swings.var(axis=0, ddof=1).sum()) / len(swings)
    size = math.sqrt(max(float(mean @ mean) - scattered, 0.0) / 2)
    least = math.sqrt(scattered / 2)
    slope = mean / (2 * max(size, least)) if max(size, least) > 0 else mean
    return Ripple(size, (swings - mean) @ slope)


def count_u(t: Turning, counts: int) -> float:
    """Standard uncertainty of a speed by the encoder's counts, rad/s: each sample is off by a part of one (rectangular, u of
    a count/sqrt 12), and the slope of n samples over T by sqrt 12/(T sqrt n) of that."""
    return 2 * math.pi / counts / (t.seconds * math.sqrt(t.samples))


def whole_turns(samples: int, rate_hz: float, speed: float) -> int:
    """How many of `samples` at a rate are whole turns: of currents that swing with the turn a part of one has another mean."""
    turn = 2 * math.pi / abs(speed) * rate_hz
    return round(int(samples / turn) * turn)


@dataclass(frozen=True)
class Expected:
    """What a plan is expected to come to, before anything starts: carrying current A, torque currents A and speeds rad/s
    by sharing."""

    carrying: float
    torque: dict[str, float]
    speed: dict[str, float]


def expected(
    limit: float, carrying: float, per_A: float, drag: float, constant: float, sideways: float = 0.0
) -> Expected:
    """`per_A`: torque per ampere N m/A; `drag` N m s/rad; `constant` torque N m; `sideways` the size of i_x, A."""
    i_x, i_y = np.array([sideways]), np.array([carrying])
    torque = {s: float(bound(limit, i_x, i_y, s)[0]) for s in SHARINGS}
    return Expected(carrying, torque, {s: (per_A * i - constant) / drag for s, i in torque.items()})
