"""From the answers of currents to the zeros: arrays in and out.

Motors m of one loop give K_m (sin d_m i_d,m + cos d_m i_q,m), d_m the angle by which the controller's frame is ahead of the
field (a current i in that frame is i e^(j d) in the field's). While a mover stands still this sum does not change, whatever a
constant load, friction or cogging is:

    sum over m of (S_m Di_d,m + C_m Di_q,m) = 0,   S_m = K_m sin d_m,  C_m = K_m cos d_m.

One motor: tan d = -Di_q/Di_d. Two that have one i_q, a step of i_d in one: K_1 sin d_1 Di_d = -Di_q (K_1 cos d_1 +
K_2 cos d_2): two equations for three unknowns. A step across, of i_q in the first alone, is the third. S and C of n motors are
2 n unknowns up to a scale, and 2 n - 1 steps tell them: what the rows of answers leave free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
FREE = 1e-3  # singular value of the rows, of the greatest, at which more than a scale is left free


@dataclass(frozen=True)
class Field:
    """Of each motor of a group (n,): the `angle` by which the controller's frame is ahead, rad, and the `constant`, as a share
    of the greatest."""

    angle: Array
    constant: Array


def field(rows: Array) -> Field:
    """Of answers (2 n - 1, 2 n) A: i_d and i_q of each motor in turn.

    Raises:
        AnalysisError: they do not tell them.
    """
    _, sizes, turns = np.linalg.svd(rows)
    if sizes[-1] < FREE * sizes[0]:
        raise AnalysisError("the answers are too much alike to tell the motors apart")
    found = turns[-1].reshape(-1, 2)
    if found[:, 1].sum() < 0:  # together the motors give force the way that their loop expects, or it would not hold
        found = -found
    size = np.hypot(*found.T)
    return Field(np.arctan2(*found.T), size / size.max())


def turned(angle: float, phase: float, coils: int) -> tuple[Array, Array]:
    """What relative errors of the gains of coils (n,) do to a measured angle, rad, and to the logarithm of its constant.

    Coil k at a_k = k 120 deg has i_k = i_d cos(phase + a_k) - i_q sin(phase + a_k). Reading (1 + e_k) of it, the dq current is
    read as (1 + E) of itself, E = (2/n) sum e_k v v', v = (cos, -sin)(phase + a_k). By the rows the field h (sin, cos) is then
    (1 + E)^-1 of the true one: to first order E h is to be added. A quarter of a turn on, the part of E that turns has the
    other sign.
    """
    at = phase + 2 * math.pi / 3 * np.arange(coils)
    along, across = np.cos(at), -np.sin(at)
    s, c = math.sin(angle), math.cos(angle)
    onto, beside = s * along + c * across, c * along - s * across
    return 2 / coils * onto * beside, 2 / coils * onto**2
