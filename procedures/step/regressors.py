"""What of a step its curve goes with, linearly: size, where it began, and both; the square of the size where that is plain."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from procedures.step.steps import Case

Array = npt.NDArray[np.float64]
# Regressors up to first order, with what steps away from the middle have beside those back to it, and all, with the square of
# the size; variance ratio from which the latter is used.
FIRST, SECOND, PLAIN = 4, 5, 10.0
BOTH = 3  # the regressor of what steps away have beside those back


def regressors(case: Case, begin: float, largest: float) -> tuple[float, ...]:
    """1, the signed size, where the step began beside the mean of those of its size and way, both together (of which that mean
    has nothing); then the square of the size."""
    size = case.way * case.size / largest
    began = begin / largest + size / 2
    return 1.0, size, began, size * began, size**2


def order_of(design: Array, faded: Array) -> int:
    """How many columns of the design: all where the second order is plain in what fades (k, m), as with an integrator that
    carries a third of the step; else those of first order, which leave the smallest steps far more certain."""
    rest = []
    for many in (FIRST, design.shape[1]):
        used = design[:, :many]
        rest.append(float(((faded - used @ np.linalg.lstsq(used, faded, rcond=None)[0]) ** 2).sum()))
    more, dof = design.shape[1] - FIRST, len(design) - design.shape[1]
    return design.shape[1] if dof >= more and (rest[0] - rest[1]) / more > PLAIN * rest[1] / dof else FIRST


def spread_of(design: Array) -> Array:
    """Variance of the design's coefficients (k, k) in units of a largest step's; zeros for columns that are not used."""
    out = np.zeros((SECOND, SECOND))
    used = design.shape[1]
    out[:used, :used] = np.linalg.pinv(design.T @ design)
    return out


def left_out(seen: Array, variance: Array) -> Array:
    """What steps away have beside those back (n,), as far as it is more than its noise of `variance` (n,)."""
    return np.asarray(np.sign(seen) * np.sqrt(np.maximum(seen**2 - variance, 0.0)))


def beside(case: Case, largest: float, square: float) -> float:
    """Standard uncertainty of what goes with the square of the size, over that, where the curve has not the square; `square` of
    the sizes in its mean. A stiffness that is another one where a step ends goes with (m + s/2)² there, m its middle and s its
    size; of that m s is what steps away have, twice as much as s²/4 and the m² = s²/4 of steps from and to the same place have
    of the square: half of it at most, one way or the other."""
    return 0.5 / math.sqrt(3) * abs((case.size / largest) ** 2 - square)
