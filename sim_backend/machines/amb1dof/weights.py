"""FIR weights of the algebraic derivative whose integral is exact: the firmware's table for its rule 2.

The estimate of (4.6) is y'(t_n) = K (K - 1) y_n/tau - (1/tau) int_0^1 w(x) y(x tau) dx, tau = n T since the reset, with a
polynomial w of degree K - 2. Between samples y is taken as straight; what that leaves is put right by the least change of the
weights that makes them exact for polynomials of degree K - 1, as the continuous form is.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb, factorial

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def kernel(degree: int) -> Array:
    """Coefficients (K - 1,) of w, ascending: with a_1p = K!^2/(p!^2 (K - p)!) of (4.15),
    w(x) = -(-1)^K sum_p a_1p (1 - x)^(K-2-p)/(K-2-p)! (-x)^p, p = 0 .. K - 2."""
    out = np.zeros(degree - 1)
    for p in range(degree - 1):
        left = degree - 2 - p
        scale = (-1) ** p * factorial(degree) ** 2 / (factorial(p) ** 2 * factorial(degree - p)) / factorial(left)
        for j in range(left + 1):
            out[p + j] += scale * comb(left, j) * (-1) ** j
    return np.asarray(-out * (-1.0) ** degree)


def weights(degree: int, n: int, tick_s: float) -> Array:
    """Weights (n + 1,), 1/s, of the samples from the reset to n after it, the newest last."""
    w = np.polynomial.Polynomial(kernel(degree))
    area, moment = w.integ(), (w * np.polynomial.Polynomial([0.0, 1.0])).integ()
    x = np.arange(n + 1) / n
    whole, first = np.diff(area(x)), np.diff(moment(x))  # of each interval: int w dx, int w x dx
    late = n * (first - x[:-1] * whole)
    out = np.zeros(n + 1)
    out[:-1] += whole - late
    out[1:] += late
    out[-1] += degree * (degree - 1)
    powers = np.vander(x - 1, degree, increasing=True).T
    wanted = np.zeros(degree)
    wanted[1] = 1.0
    q, r = np.linalg.qr(powers.T)
    out += q @ np.linalg.solve(r.T, wanted - powers @ out)
    return np.asarray(out / (n * tick_s))


@lru_cache(maxsize=16)
def table(degree: int, first: int, last: int, tick_s: float) -> Array:
    """Rows (last - first + 1, last + 1) for `first` .. `last` samples after the reset, newest sample in the last column."""
    out = np.zeros((last - first + 1, last + 1))
    for row, n in zip(out, range(first, last + 1), strict=True):
        row[last - n :] = weights(degree, n, tick_s)
    return out
