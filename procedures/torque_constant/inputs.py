"""What the torque calibration takes from certificates: inputs of its fit, and what its checks may expect of loads and arms."""

from __future__ import annotations

import math
from collections.abc import Sequence

from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.servomotor.conventions import conventions
from procedures.shared.certificates import certified

SIDES = ("left", "right")


def fit_inputs(rig: RigFile, masses: Sequence[str]) -> dict[str, Estimate]:
    """What the fit needs besides the recording: certificates of the rig file, each as an influence by identity."""
    inputs = {
        "gravity": certified("site/gravity", rig.site.gravity, "local gravity"),
        "air_density": certified("site/air_density", rig.site.air_density, "air density (buoyancy)"),
        "mass_density": certified("masses/density", rig.mass_density, "density of the masses (buoyancy)"),
    }
    for side in SIDES:
        name = f"lever_{side}"
        inputs[name] = certified(f"geometry/{name}", rig.geometry[name], f"arm of the lever, {side}")
    for k, label in enumerate(masses):
        inputs[f"mass_{k}"] = certified(f"masses/{label}", rig.masses[label], f"mass {label}")
    for k, channel in enumerate(conventions(rig).segments, 1):
        inputs[f"gain_{k}"] = certified(f"sensors/{channel}/gain", rig.sensors[channel].gain, f"gain of {channel}")
    return inputs


def masses_u(rig: RigFile, masses: Sequence[str]) -> list[float]:
    """Relative standard uncertainty of each mass."""
    return [rig.masses[m].standard_uncertainty / rig.masses[m].value for m in masses]


def arms_u(rig: RigFile) -> float:
    """Relative standard uncertainty of the ratio of the arms."""
    arms = [rig.geometry[f"lever_{side}"] for side in SIDES]
    return math.hypot(*(a.standard_uncertainty / a.value for a in arms))
