"""Influences that the quantities of an angle step share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.servomotor.conventions import Servomotor
from procedures.shared.certificates import certified

Array = npt.NDArray[np.float64]
OUTBOARD: Mapping[str, float] = {"xo": 1.0, "yo": 1.0}
"""Shares of the position sensors in a displacement at the outboard one."""


def at_motor(share: float) -> dict[str, float]:
    """Shares of the position sensors in a displacement at the motor; `share` is the outboard ones'."""
    return {"xo": share, "yo": share, "xi": 1 - share, "yi": 1 - share}


def within(identity: str, name: str, half: float, unit: str) -> Estimate:
    """Zero, within a half width."""
    influence = Influence(
        id=identity, name=name, u=half / math.sqrt(3), unit=unit, kind="B", distribution="rectangular"
    )
    return Estimate.of(0.0, influence)


def placed(rig: RigFile, machine: Servomotor, grows: float) -> Estimate:
    """Zero, m, with what the lengths along the shaft do to a peak at the motor that `grows` by so many metres with the outboard
    sensors' share of it, (z_m + l_is)/(l_is + l_os)."""
    names = ("com_to_motor", *machine.sensors)
    z, l_is, l_os = (certified(f"geometry/{name}", rig.geometry[name]) for name in names)
    share = (z + l_is) / (l_is + l_os)
    return Estimate(0.0, "m", {i: c * grows for i, c in share.sensitivities.items()})


def gained(
    peaks: Iterable[tuple[float, Array]], shares: Mapping[str, float], gains: Mapping[str, Estimate]
) -> Estimate:
    """Zero, m, with what the gains of the position sensors do to the mean of some peaks, each a distance r off centre with its
    direction (2,): dr = -(x^2 dg_x + y^2 dg_y)/r for one plane.

    At the motor each plane's sensors act by the plane's share in the extrapolation, both planes being off by much the same.
    """
    along = np.mean([radius * np.square(towards) for radius, towards in peaks], axis=0)
    out = Estimate.exact(0.0, "m")
    for sensor, part in shares.items():
        gain = gains[sensor]
        out = out + (gain - gain.value) * (-float(along[0 if sensor[0] == "x" else 1]) * part / gain.value)
    return Estimate(out.value, "m", out.sensitivities)
