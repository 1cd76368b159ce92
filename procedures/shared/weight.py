"""Weight of a mass in air."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
CONVENTIONAL_AIR = 1.2  # kg/m^3, OIML R 111: the air in which conventional mass is defined
CONVENTIONAL_DENSITY = 8000.0  # kg/m^3, likewise


def weight(mass_kg: float | Array, gravity: float, air_density: float, mass_density: float) -> float | Array:
    """Force in N of a conventional mass in air (OIML D 28: buoyancy against the conventional 1.2 and 8000 kg/m^3).

    The true mass of a body of density r with conventional mass m is m (1 - 1.2/8000) / (1 - 1.2/r).
    """
    true = mass_kg * (1 - CONVENTIONAL_AIR / CONVENTIONAL_DENSITY) / (1 - CONVENTIONAL_AIR / mass_density)
    return true * gravity * (1 - air_density / mass_density)
