"""At which frequencies a loop is looked at next, by what was seen of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from procedures.loop_response.fit import HALF
from procedures.loop_response.plan import Plan

FALLEN = 0.5  # of |y/r|: a survey goes on until it is below
HALVINGS = 3  # of what encloses the -3 dB point
ACROSS, LEAST = 0.1, 0.03  # of the logarithm of |y/r|, and of the frequency
WIDE = math.log(2.0)  # of the logarithm of the frequency: a gap that may hide a maximum of |S|
BESIDE = 2  # halvings of what is beside the greatest sensitivity
DOWN = 0.08  # of the logarithm of |S|, by which it is less at the outer lines about its maximum
PEAK_WITHIN = (0.08, 0.4)  # of the logarithm of the frequency: how far about a maximum lines lie


def survey(plan: Plan) -> list[float]:
    """The lines of a first look, Hz."""
    return [float(f) for f in np.geomspace(plan.low_hz, plan.high_hz, plan.lines)]


def goes_on(seen: Mapping[float, float]) -> bool:
    """Whether the survey of |y/r|, by frequency, goes on upwards."""
    return not seen or min(seen.values()) > FALLEN


def halving(seen: Mapping[float, float]) -> float | None:
    """Between which lines the last fall through -3 dB is: the frequency in their middle; None where there is none."""
    hz = sorted(seen)
    above = [k for k in range(len(hz) - 1) if seen[hz[k]] >= HALF > seen[hz[k + 1]]]
    return float(np.sqrt(hz[above[-1]] * hz[above[-1] + 1])) if above else None


def fall(seen: Mapping[float, float], most: float) -> tuple[float, float] | None:
    """Where the last fall through -3 dB is, interpolated, and how far about it lines should lie, of the logarithm of the
    frequency: until the response has changed by ACROSS, `most` at most; None where there is no fall."""
    for one, other in reversed(list(pairwise(sorted(seen)))):
        if seen[one] >= HALF > seen[other]:
            steep = np.log(seen[one] / seen[other]) / np.log(other / one)
            at = one * (seen[one] / HALF) ** (1 / steep)
            return float(at), float(np.clip(ACROSS / steep, LEAST, most))
    return None


def gaps(seen: Mapping[float, float]) -> list[float]:
    """The middles of gaps wider than an octave where |S| is above one on either side: its greatest may be in one of them."""
    return [
        float(np.sqrt(one * other))
        for one, other in pairwise(sorted(seen))
        if math.log(other / one) > WIDE and max(seen[one], seen[other]) > 1
    ]


def most_in_gaps(plan: Plan) -> int:
    """How many lines `gaps` may ask for, time and again, until none is wide."""
    width, count = math.log(plan.high_hz / plan.low_hz) / (plan.lines - 1), 1
    while width / count > WIDE:
        count *= 2
    return (plan.lines - 1) * (count - 1)


def beside(seen: Mapping[float, float]) -> list[float]:
    """The middles of the two gaps beside the greatest; one where it is the first or the last."""
    hz = sorted(seen)
    k = max(range(len(hz)), key=lambda j: seen[hz[j]])
    return [float(np.sqrt(hz[j] * hz[j + 1])) for j in (k - 1, k) if 0 <= j < len(hz) - 1]


def top(seen: Mapping[float, float]) -> tuple[float, float]:
    """Where the greatest is, by a parabola through it and its neighbours; the line itself where it is the first or the last.
    And how far about it lines should lie, of the logarithm of the frequency: where it has fallen by DOWN."""
    hz = sorted(seen)
    k = max(range(len(hz)), key=lambda j: seen[hz[j]])
    if not 0 < k < len(hz) - 1:
        return hz[k], PEAK_WITHIN[1]
    x = np.log(np.array(hz[k - 1 : k + 2]) / hz[k])
    c, b, _ = np.polyfit(x, np.log([seen[f] for f in hz[k - 1 : k + 2]]), 2)
    if c >= 0:
        return hz[k], PEAK_WITHIN[1]
    return float(hz[k] * np.exp(np.clip(-b / (2 * c), x[0], x[2]))), float(np.clip(np.sqrt(-DOWN / c), *PEAK_WITHIN))


def about(hz: float, within: float, count: int) -> list[float]:
    """So many lines about a frequency."""
    return [float(hz * np.exp(x)) for x in np.linspace(-within, within, count)]
