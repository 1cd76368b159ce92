"""Whether a shaft that turns swings across its step as well.

Gyroscopic moments turn a tilt along y into one along z. Where a step of the centre of mass tilts the shaft, as one beyond its
bearings does, y and z then share four oscillations, and two are what would be fitted. What is wrong with the fit goes with the
square of what is seen across: at .037 of the step damping was 3.5 U off and the bandwidth 1.7, at .07 and .17 three to five; at
.007, the most that shafts with their centre of mass between alike bearings show, nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from procedures.step.steps import TURNING_RAD_S, Done

ASIDE = 0.02  # of a step
SURELY = 4.0  # standard deviations of noise that the greatest of some hundred samples may be
LAST = 200  # samples, at the end of a record, that tell it


def whirls(steps: Sequence[Done]) -> bool:
    """Of the largest steps of a setting, an axis and a speed, in the mean; never at rest."""
    if steps[0].case.speed < TURNING_RAD_S:
        return False
    largest = max(d.case.size for d in steps)
    aside = [d.across / d.case.size for d in steps if d.case.size == largest]
    mean = np.mean([x[: min(map(len, aside))] for x in aside], axis=0)
    return bool(np.abs(mean).max() > ASIDE + SURELY * mean[-LAST:].std())
