"""How often a sound interval's error is far beyond it: the probabilities that errors beyond 2 U, 3 U and 10 U are judged by.

The half width is the one on the side towards the truth, since an interval need not be symmetric.
"""

from __future__ import annotations

import math

import numpy as np

from bench.uncertainty.estimate import Array

MULTIPLES = (2.0, 3.0, 10.0)
Tails = tuple[float, ...]
"""One for each of the multiples."""


def tails_of_t(k: float, dof: float) -> Tails:
    """P(|T| > m k) for the multiples m of a half width of k standard uncertainties: Student's t, normal with infinite
    degrees of freedom."""
    from scipy.special import ndtr, stdtr

    return tuple(2 * float(ndtr(-m * k) if math.isinf(dof) else stdtr(dof, -m * k)) for m in MULTIPLES)


def tails_of_draws(draws: Array, value: float, low: float, high: float) -> Tails:
    """The share of JCGM 101 draws further from the value than the multiples of the interval's half width on their side."""
    below, above = max(value - low, 0.0), max(high - value, 0.0)
    return tuple(float(np.mean((draws < value - m * below) | (draws > value + m * above))) for m in MULTIPLES)
