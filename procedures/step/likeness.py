"""Whether steps are what was fitted to them: what the fits leave of their mean, beside what single steps scatter by.

Two oscillations and what fades are not all that a loop can do. Bearings whose controllers are unlike, with poles that filters
and current loops are not faster than, leave .002 to .005 of a step in its first swings: overshoots were up to 23 U off and
frequencies 6. Each step hides that in its noise; all of one axis together do not: the mean squares of such axes of drawn
spindles are 7 to 28 times those of their scatter where results are off (7 U and more on 5 axes), and 0.1 to 2.3 on 65 axes
where they are not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from procedures.step.oscillation import FROM_S, Array, One, Swing
from procedures.step.steps import Case

FIRST_S = 12e-3  # end of the first swings, whose top is the overshoot
FEWEST = 4  # samples in the first swings: fewer tell nothing
UNLIKE = 4.0  # of mean squares over those of scatter: 1 in the mean


def astray(fits: Mapping[Case, list[Swing]], ones: Mapping[Case, Sequence[One]]) -> set[Case]:
    """Cases of the axes whose steps do not follow the fits to them, the first of which is that of all steps of a case."""
    out: set[Case] = set()
    for group in {case.group for case in fits}:
        of = [case for case, found in fits.items() if case.group == group and found]
        if not follows([(fits[case][0], ones[case]) for case in of]):
            out |= {case for case in fits if case.group == group}
    return out


def follows(fits: Sequence[tuple[Swing, Sequence[One]]]) -> bool:
    """Whether the steps of one axis follow what was fitted to those of each case: what all leave together over what they
    scatter by there, large steps counting more."""
    left = [(s, _left(s, f)) for f, ones in fits for s in ones]
    early = [rest[(s.t > FROM_S) & (s.t < FIRST_S)] for s, rest in left]
    count = min(map(len, early), default=0)
    if count < FEWEST:
        return True
    shares = np.array([s.weight**2 for s, _ in left])
    shares /= shares.sum()
    each = np.array([x[:count] for x in early])
    mean = shares @ each
    scatter = (shares**2 @ (each - mean) ** 2) * len(each) / (len(each) - 1)
    return bool((mean**2).sum() < UNLIKE * scatter.sum())


def _left(step: One, fitted: Swing) -> Array:
    return np.asarray(step.both[0] - fitted.means(step.t, float(step.t[1] - step.t[0])))
