"""The amount of a vector that may be so short that its uncertainty is all of it.

A measured amount r of a vector of length a, whose components scatter by s, has Rice's distribution and is too great on the
average: at a = 0 no interval about r holds it. The interval here is that of the lengths at which r is no surprise: draws follow
the confidence distribution C(a) = P(r or more | a) = Q_1(a/s, r/s), Marcum's function, a noncentral chi-square in r^2 (Rice,
Bell Syst. Tech. J. 24, 46 (1945), 3.10; Schweder and Hjort, Confidence, Likelihood, Probability, chapter 3). Far from zero that
is the normal interval along the vector.
"""

from __future__ import annotations

import math

import numpy as np

from bench.uncertainty import Estimate
from bench.uncertainty.estimate import Array, Deviations, merged

REACH, STEPS = 8.0, 801  # of the lengths that are tried, in standard uncertainties beyond the measured one


def amount(x: Estimate, y: Estimate) -> Estimate:
    """Length of the vector (x, y), in their unit: the measured one, with the influences of its components along it and the
    interval by Monte Carlo. Components of unlike uncertainty count as two of their mean variance; one shorter than that is
    taken for as long, lest chance make an interval of nothing."""
    from scipy.special import chndtr, ndtr

    r = math.hypot(x.value, y.value)
    way = (x.value / r, y.value / r) if r else (1.0, 0.0)
    along = Estimate(0.0, x.unit, merged([(way[0], x), (way[1], y)]))
    s = math.sqrt((x.u**2 + y.u**2) / 2)
    if not (s and along.u):
        return Estimate(r, x.unit, along.sensitivities)
    lengths = np.linspace(0, r + REACH * s, STEPS)
    confidence = np.maximum.accumulate(1 - chndtr((max(r, s) / s) ** 2, 2, (lengths / s) ** 2))

    def sampler(deviations: Deviations) -> Array:
        drawn = ndtr(along.sampled(deviations) / along.u)
        return np.asarray(np.interp(drawn, confidence, lengths))

    return Estimate(r, x.unit, along.sensitivities, sampler)
