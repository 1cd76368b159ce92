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
    """Mean `speed` over `turns` whole turns, which the first `samples` are, rad/s with its sign, and `ripple`, the rms of its
    orders 1 to 4, rad/s."""

    speed: float
    turns: int
    samples: int
    ripple: float


def turning(t: Array, angle: Array) -> Turning:
    """Of angles (n,) rad within a turn at times (n,) s.

    Times at which the angle passes where it began, turn after turn, are interpolated between samples: a whole number of turns,
    so that what the encoder says wrongly over a turn is left out, and what runout does to the speed. The ripple is that of the
    harmonics of the unwrapped angle over itself: theta = w t + sum a_n cos(n theta) + b_n sin(n theta) gives
    w' = w sum n (b_n cos - a_n sin), which no filter has weakened.

    Raises:
        AnalysisError: it turns less than twice.
    """
    unwrapped = np.unwrap(angle)
    way = 1.0 if unwrapped[-1] >= unwrapped[0] else -1.0
    turned = way * (unwrapped - unwrapped[0])
    turns = int(turned[-1] / (2 * math.pi))
    if turns < FEWEST_TURNS:
        raise AnalysisError(
            f"window: the rotor turns {turned[-1] / (2 * math.pi):.2f} times; expected {FEWEST_TURNS} or more"
        )
    end = 2 * math.pi * turns
    last = int(np.searchsorted(turned, end))
    part = (end - turned[last - 1]) / (turned[last] - turned[last - 1])
    seconds = float(t[last - 1] + part * (t[last] - t[last - 1]) - t[0])
    speed = end / seconds
    x, time = turned[: last + 1], t[: last + 1]
    waves = [wave(n * x) for n in ORDERS for wave in (np.cos, np.sin)]
    design = np.column_stack([np.ones_like(time), time - time[0], *waves])
    terms = np.linalg.lstsq(design, x, rcond=None)[0][2:].reshape(-1, 2)
    size = float((np.array(ORDERS) ** 2 * (terms**2).sum(axis=1)).sum())
    return Turning(way * speed, turns, last, speed * math.sqrt(size / 2))


def whole_turns(samples: int, rate_hz: float, speed: float) -> int:
    """How many of `samples` at a rate are whole turns: of currents that swing with the turn a part of one has another mean."""
    turn = 2 * math.pi / abs(speed) * rate_hz
    return round(int(samples / turn) * turn)


def count_u(speed: float, turns: int, counts: int) -> float:
    """Standard uncertainty of a speed by the encoder's count at both ends of whole turns, rad/s: rectangular, 1/(counts n)."""
    return abs(speed) / (counts * turns) / math.sqrt(6)


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
