"""The true quantities of the one-axis AMB that do not go with a plan."""

from __future__ import annotations

import math

from sim_backend.machine import Numbers
from sim_backend.machines.amb1dof.params import PlantParams


def quantities(p: PlantParams, settings: Numbers) -> dict[str, float]:
    """The static control current, A, held where the position sensor reads zero."""
    bias, y = settings["bias"], -p.position_offset / p.position_gain
    near, far = (p.gap - y) ** 2, (p.gap + y) ** 2
    # beta ((b + i)^2/near - (b - i)^2/far) = -load: a quadratic in i
    a, b, c = 1 / near - 1 / far, 2 * bias * (1 / near + 1 / far), bias**2 * (1 / near - 1 / far) + p.load / p.beta
    root = math.sqrt(b * b - 4 * a * c)
    return {"i_static": 2 * -c / (b + root)}
