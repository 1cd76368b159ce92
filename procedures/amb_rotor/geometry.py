"""From readings of two planes to where the shaft is: centre of mass, tilts, distances to the rings (T 2.17)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from procedures.amb_rotor.conventions import conventions

Array = npt.NDArray[np.float64]
YI, ZI, YO, ZO = range(4)


@dataclass(frozen=True)
class Facts:
    """What the readings are turned into positions with: sensors' `gains` and `offsets` m (yi, zi, yo, zo), lengths from the
    centre of mass to the sensors m, when the reference's phase was zero (s), the rings' `clearance` m."""

    gains: tuple[float, float, float, float]
    offsets: tuple[float, float, float, float]
    l_is: float
    l_os: float
    t_0: float
    clearance: float


def centre(readings: Array, f: Facts) -> Array:
    """y, z of the centre of mass from where the sensors read zero, psi, theta: (4, n); T (2.17) solved."""
    yi, zi, yo, zo = readings / np.array(f.gains)[:, None]
    theta, psi = (yo - yi) / (f.l_is + f.l_os), (zi - zo) / (f.l_is + f.l_os)
    return np.array([yi + f.l_is * theta, zo + f.l_os * psi, psi, theta])


def distances(readings: Array, f: Facts) -> Array:
    """Of the shaft from the rings' centre at the inboard and the outboard sensors, (2, n) m."""
    at = (readings - np.array(f.offsets)[:, None]) / np.array(f.gains)[:, None]
    return np.array([np.hypot(at[YI], at[ZI]), np.hypot(at[YO], at[ZO])])


def nominal(rig: RigFile, t_0: float) -> Facts:
    """The facts as the rig file states them."""
    sensors, g = [rig.sensors[name] for name in conventions(rig).positions], rig.geometry
    gains, offsets = [s.gain.value for s in sensors], [s.offset.value for s in sensors]
    return Facts(
        (gains[0], gains[1], gains[2], gains[3]),
        (offsets[0], offsets[1], offsets[2], offsets[3]),
        g["com_to_inboard_sensor"].value,
        g["com_to_outboard_sensor"].value,
        t_0,
        g["clearance"].value,
    )
