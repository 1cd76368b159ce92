"""What a shaft that runs through its speeds shows, against what it would show at each of them.

The response lags behind the speed: with the acceleration a, an excitation F(w) e^(j theta) and the shaft's H, the vector is

    V = integral of h(s) F(w - a s) e^(-j w s) e^(j a s^2/2) ds = Y - j a/2 (Y'' - H F'') + ..., Y = H F,

with F'' = 2 F/w^2 of an unbalance: at a peak of half-power width 2 d the next term is smaller by a/d^2 (Lewis, Trans. ASME 54,
APM-54-24 (1932), has the whole of it for one degree of freedom). A block over which the speed goes by b shows the mean of V,
V + b^2/24 V''. The whole series is V = exp(-C) Y with
C = j a/2 (d^2/dw^2 - 2/w^2) - b^2/24 d^2/dw^2, so that

    Y = V + C V + C C V/2 + ...,

the derivatives those of local rational models. What the last term changes bounds what is left.
"""

from __future__ import annotations

import numpy as np

from bench.analysis.peaks import WINDOW, Smoother, pooled_covariance, smoother
from bench.analysis.sampling import Array, Complex
from bench.errors import AnalysisError


def local(speed: Array, values: Complex, covariance: Array) -> Smoother:
    """The local models, of nine blocks each, of a passage's vectors `values` (b,), without runout, at `speed` (b,) rad/s,
    ascending; `covariance` (b, 2, 2) of their scatter weighs them.

    Raises:
        AnalysisError: fewer than nine blocks, or speeds that do not ascend.
    """
    if speed.size < WINDOW or not (np.diff(speed) > 0).all():
        raise AnalysisError(f"passage: found {speed.size} blocks; expected {WINDOW} or more, at ascending speeds")
    return smoother(speed, values, pooled_covariance(covariance), WINDOW)


def series(
    smooth: Smoother, speed: Array, values: Complex, acceleration: Array, width: Array, rounds: int = 2
) -> list[Complex]:
    """Vectors as they would be if each speed stood: the sums of the series after none, one, ... `rounds` terms, (b,) each.

    Args:
        smooth: the local models.
        speed: (b,) rad/s, ascending.
        values: (b,), without runout, which follows without a lag.
        acceleration: (b,) rad/s^2, below 0 on the way down.
        width: (b,) rad/s, by how much the speed changes over each block.
        rounds: terms of the series.
    """
    sums, term = [values], values
    for k in range(1, rounds + 1):
        bent = smooth.curvature(term)
        lag = 0.5j * acceleration * (bent - 2 * smooth.at_lines(term) / speed**2)
        term = (lag - width**2 / 24 * bent) / k
        sums.append(sums[-1] + term)
    return sums
