"""What the poles of the two observers predict: how much more the full one lets a load move the body.

After a step of the load both loops creep back at the slow pole s; e is s dF/h_1 with the reduced observer (4.22) and
s dF m (l_2 + k_v l_1)/l_3 with the full one (4.21), k_v the damping of the feedback (4.20).
"""

from __future__ import annotations

import math

import numpy as np

from bench.rigfile import RigFile
from procedures.one_axis.conventions import OneAxis

NEEDED = ("mass", "harmonic_hz", "damping", "slow_pole", "fast_poles", "full_poles")


def ratio(mass: float, harmonic_hz: float, damping: float, slow: float, fast: float, full: float) -> float:
    """m h_1 (l_2 + k_v l_1)/l_3, poles in 1/s.

    Of the three h_1 = c_3/w^2, of the five l_1 = c_1, l_2 = c_2 - w^2, l_3 = c_5 m/w^2."""
    square = (2 * math.pi * harmonic_hz) ** 2
    few, many = np.poly([slow, fast, fast]), np.poly([full, full, slow, fast, fast])
    return float(mass * few[3] / square * (many[2] - square + damping * many[1]) / (many[5] * mass / square))


def predicted_ratio(rig: RigFile, machine: OneAxis) -> float | None:
    """By what the controller knows; None where it does not tell all of it."""
    if any(meaning not in machine.can.model for meaning in NEEDED):
        return None
    return ratio(*(machine.known(rig, meaning) for meaning in NEEDED))
