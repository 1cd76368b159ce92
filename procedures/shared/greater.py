"""The greater of two estimates: Clark, Oper. Res. 9, 145 (1961).

Where two numbers are nearer to each other than they are known, the greater of both lies above either: of X and Y, normal, whose
difference has the standard deviation t, with a = (E X - E Y)/t,

    E max(X, Y) = E X Phi(a) + E Y Phi(-a) + t phi(a),        dE/dX = Phi(a),  dE/dY = Phi(-a).

Of two rectangular ones that are alike t phi(0) is 0.33 of a half width, as it is for them. The interval is by draws.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from bench.uncertainty import Estimate, Influence
from bench.uncertainty.estimate import Deviations

SURE = 6.0  # standard deviations apart: which one is the greater


def greater(x: Estimate, y: Estimate) -> Estimate:
    """max(x, y), in the unit of x: its expectation, and an interval by draws where either may be the greater."""
    apart = math.hypot(*(x - y).contributions.values())
    if abs(x.value - y.value) >= SURE * apart:
        return x if x.value >= y.value else y
    a = (x.value - y.value) / apart
    share = 0.5 * (1 + math.erf(a / math.sqrt(2)))
    density = math.exp(-a * a / 2) / math.sqrt(2 * math.pi)
    parts: dict[Influence, float] = {}
    for weight, estimate in ((share, x), (1 - share, y)):
        for influence, c in estimate.sensitivities.items():
            parts[influence] = parts.get(influence, 0.0) + weight * c

    def sampler(deviations: Deviations) -> npt.NDArray[np.float64]:
        return np.asarray(np.maximum(x.sampled(deviations), y.sampled(deviations)))

    return Estimate(x.value * share + y.value * (1 - share) + apart * density, x.unit, parts, sampler)
