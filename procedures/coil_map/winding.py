"""What a winding gives by the table of its coils' phases: the currents of d and q in each coil, and back.

A coil at phase p carries d cos(phi + p) - q sin(phi + p), phi being the electrical angle. Of n coils that are spread evenly
the controller's current is (2/n) sum i_k (cos(phi + p_k), -sin(phi + p_k)): a coil that gives a share f of its force takes
(1 - f)(2/n) u u^T away from what the system pushes, u = (cos, -sin)(phi + p).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_coils import CoilMap, CoilSystem

Array = npt.NDArray[np.float64]
DEG = np.pi / 180


def phase(rig: RigFile, system: CoilSystem, reading: Array) -> Array:
    """Electrical angle of readings of the system's angle, rad."""
    zero = rig.parameters[system.zero].default if system.zero else 0.0
    return np.asarray(system.per * reading - zero)


def of_way(system: CoilSystem, way: str, phi: Array) -> dict[str, Array]:
    """What 1 A of d or q is in each coil, at electrical angles (n,)."""
    of = np.cos if way == "d" else lambda x: -np.sin(x)
    return {coil: np.asarray(of(phi + p * DEG)) for coil, p in system.coils.items()}


def beside(can: CoilMap, name: str) -> str:
    """The system that has the same coils and gives torque; "" where there is none."""
    own = set(can.systems[name].coils)
    return next((n for n, s in can.systems.items() if n != name and set(s.coils) == own and s.gives == "torque"), "")


def unit(system: CoilSystem, coil: str, phi: float) -> Array:
    """Along which a coil's current counts in its system's (d, q), (2,)."""
    at = phi + system.coils[coil] * DEG
    return np.array([np.cos(at), -np.sin(at)])


def taken_by(system: CoilSystem, coil: str, phi: float, gives: float) -> Array:
    """What a coil that gives a share of its force leaves of the system's pushes, (2, 2)."""
    u = unit(system, coil, phi)
    return np.asarray(np.eye(2) - (1 - gives) * 2 / len(system.coils) * np.outer(u, u))
