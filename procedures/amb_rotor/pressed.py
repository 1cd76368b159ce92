"""Where coils and weight press a shaft that is not held: which force its rings cannot give, by the controller's own model.

Force constants and offsets of the bearings are those that the controller has (`capabilities.model`): good enough to say which
way a coil presses. Where it has none, nothing of this is told.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from procedures.amb_rotor import magnetics
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.stations import row, stated

Array = npt.NDArray[np.float64]
TOUCHES = 0.85  # of the clearance
FRICTION = 0.15  # of a ring's force
UNKNOWN = (
    "that takes the controller's force constants and offsets of the bearings (capabilities.model), their gaps, the mass of the "
    "shaft, two rings and a probe along each axis"
)


@dataclass(frozen=True)
class Known:
    """`reads`, `pulls` (4, 4): displacements at probes and at axes, of the shaft's coordinates, the axes' own order; `rings`
    (4, 4) those at both rings, y and z of the near one first; `clearance` (2,) m; of the axes' magnets `beta` N m^2/A^2,
    `offset` and `gap` m, each (4,); `weight` (4,) N and N m."""

    reads: Array
    pulls: Array
    rings: Array
    clearance: Array
    beta: Array
    offset: Array
    gap: Array
    weight: Array


def known(rig: RigFile) -> Known | None:
    """What the rig file and the controller's defaults say; None where one of them does not."""
    machine, s = conventions(rig), conventions(rig).stations
    mass = stated(rig, None if rig.shaft is None else rig.shaft.mass, "shaft.mass")
    names = [(machine.model_beta(a), machine.model_offset(a)) for a in machine.axes]
    if (
        mass is None
        or len(s.rings) != 2
        or not all(b and o for b, o in names)
        or not {*machine.axes} <= machine.gaps.keys()
    ):
        return None
    reads = np.array([s.probes[name].row for name in machine.positions])
    rings = sorted(s.rings, key=lambda r: r.plane)
    arms = [r.arm.value if r.arm is not None else s.probes[machine.positions[2 * r.plane]].arm.value for r in rings]
    if abs(arms[1] - arms[0]) < 1e-6:
        return None
    beta, offset = (np.array([rig.parameters[pair[k]].default for pair in names]) for k in (0, 1))
    weight = -mass.value * rig.site.gravity.value * np.array([*s.up, 0.0, 0.0])
    sides = np.array([row(arm, angle) for arm in arms for angle in (0.0, math.pi / 2)])
    return Known(reads, s.pulls, sides, np.array([r.clearance.number.value for r in rings]), beta, offset,
                 np.array([machine.gaps[a] for a in machine.axes]), weight)  # fmt: skip


def unexplained(read: Array, p: Array, n: Array, of: Known) -> float:
    """Force in N that the rings cannot give, with the shaft at rest where `read` (4,) m says and coil currents `p`, `n` (4,) A.

    Magnets and weight are carried to the rings' planes. A ring pushes inwards, where the shaft touches it, and along its face
    by friction.
    """
    q = np.linalg.solve(of.reads, read)
    at = of.pulls @ q
    force = np.array([magnetics.magnet(b, o, g, x, i, j) for b, o, g, x, i, j in
                      zip(of.beta, of.offset, of.gap, at, p, n, strict=True)])  # fmt: skip
    pull = np.linalg.solve(of.rings.T, of.pulls.T @ force + of.weight).reshape(2, 2)
    total = 0.0
    for where, pressing, clear in zip((of.rings @ q).reshape(2, 2), pull, of.clearance, strict=True):
        far = float(np.hypot(*where))
        if far < TOUCHES * clear:
            total += float(np.hypot(*pressing)) ** 2
            continue
        outward = float(pressing @ where) / far
        across = abs(float(pressing[1] * where[0] - pressing[0] * where[1])) / far
        total += min(outward, 0.0) ** 2 + max(across - FRICTION * max(outward, 0.0), 0.0) ** 2
    return math.sqrt(total)
