"""The bare model: statics of a shaft in two planes in which magnets pull it and a current holds it. Arrays in and out.

At rest the forces of the planes carry the weight and have no moment about the centre of mass,

    F_1 + F_2 = W,   s_1 F_1 + s_2 F_2 = 0,   F_k = K_k e^(j d_k) i_k + P_k (x_k + m_k)   (complex: along d, along q),

with s_k where the planes are from the centre of mass: so each F_k is a constant, wherever the shaft is and however it
tilts. The current of a plane goes with the place of the shaft in that plane alone,

    i_k = e^(-j d_k) (F_k/K_k - P_k/K_k (x_k + m_k)),

no other plane, lever, mass or moment of inertia has a part in it. Of the probes' readings y, at planes l_s where the motors
are at l_b, x_1 = (1 + r)/2 y_1 + (1 - r)/2 y_2 with r = l_b/l_s. So the sum of both slopes, that of both planes moved alike,
is P_k/K_k without any lever; how they share it tells r. The slope is a vector: its length has no cosine of the frame's
angle d_k, which its direction shows, against the probes.

    i = A y + b   of all four currents (d_1, q_1, d_2, q_2) and readings;   y_0 = -A^-1 b: no current at all.

Readings and not set points stand in it: an integrator that has not settled leaves i and y on this line, but for m y''/K.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
FREE = 1e-3  # singular value, of the greatest, at which readings do not tell all slopes


@dataclass(frozen=True)
class Statics:
    """`slopes` A (4, 4) A/m, `rest` b (4,) A; covariance of the terms (A_r, b_r) and (A_s, b_s) of two rows is `spread` (4, 4)
    [r, s] times `normal` (5, 5); `left` (n, 4) A of the currents; `dof` of each."""

    slopes: Array
    rest: Array
    spread: Array
    normal: Array
    left: Array
    dof: int


def statics(readings: Array, currents: Array) -> Statics:
    """Of readings (n, 4) m and currents (n, 4) A.

    Raises:
        AnalysisError: levels that do not tell all slopes.
    """
    n = len(readings)
    scale = np.append(1 / np.maximum(readings.std(axis=0), 1e-12), 1.0)
    x = np.column_stack([readings, np.ones(n)]) * scale
    sizes = np.linalg.svd(x, compute_uv=False)
    if n < 8 or sizes[-1] < FREE * sizes[0]:
        raise AnalysisError(f"{n} levels do not tell how the currents go with each reading")
    inverse = np.linalg.inv(x.T @ x)
    scaled = inverse @ x.T @ currents
    left, terms, dof = currents - x @ scaled, scaled * scale[:, None], n - x.shape[1]
    return Statics(terms[:4].T, terms[4], left.T @ left / dof, inverse * np.outer(scale, scale), left, dof)


def without_current(s: Statics) -> tuple[Array, Array]:
    """y_0 (4,) m and its covariance (4, 4): d y_0 = -A^-1 (dA y_0 + db).

    Raises:
        AnalysisError: currents that go with no place.
    """
    if np.linalg.cond(s.slopes) > 1 / FREE:
        raise AnalysisError("the currents of some direction do not go with the place")
    at = np.asarray(-np.linalg.solve(s.slopes, s.rest), np.float64)
    inverse, here = np.linalg.inv(s.slopes), np.append(at, 1.0)
    return at, np.asarray(inverse @ s.spread @ inverse.T * float(here @ s.normal @ here), np.float64)
