"""What the torque calibration takes from certificates: inputs of its fit, and what its checks may expect of loads and arms."""

from __future__ import annotations

import math
from collections.abc import Sequence

from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.servomotor.conventions import conventions
from procedures.servomotor.loads import certified_masses, certified_weighing
from procedures.shared.certificates import certified, certified_gain

SIDES = ("left", "right")


def fit_inputs(rig: RigFile, masses: Sequence[str]) -> dict[str, Estimate]:
    """What the fit needs besides the recording: certificates of the rig file, each as an influence by identity."""
    inputs = certified_weighing(rig)
    for side in SIDES:
        name = f"lever_{side}"
        inputs[name] = certified(f"geometry/{name}", rig.geometry[name], f"arm of the lever, {side}")
    gains = {f"gain_{k}": certified_gain(rig, segment) for k, segment in enumerate(conventions(rig).turning, 1)}
    return inputs | certified_masses(rig, masses) | gains


def masses_u(rig: RigFile, masses: Sequence[str]) -> list[float]:
    """Relative standard uncertainty of each mass."""
    return [rig.masses[m].standard_uncertainty / rig.masses[m].value for m in masses]


def arms_u(rig: RigFile) -> float:
    """Relative standard uncertainty of the ratio of the arms."""
    arms = [rig.geometry[f"lever_{side}"] for side in SIDES]
    return math.hypot(*(a.standard_uncertainty / a.value for a in arms))
