"""What the axes of a shaft's bearings carry of its weight."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from procedures.amb_rotor.stations import stations
from procedures.synchronous import facts, runout
from procedures.synchronous.runout import Stand

Array = npt.NDArray[np.float64]
HANGS = 0.05  # of the weight: an axis that carries less is not held against its currents


def carried(rig: RigFile, s: Stand, means: Array) -> Array:
    """(4,): by their currents, what the coils carry of what they should of the weight; 1 where that is next to nothing."""
    due = shares(rig, s)
    some = np.abs(due) > HANGS * s.mass * rig.site.gravity.value
    return np.asarray(np.where(some, runout.mean_forces(s, means) / np.where(some, due, 1.0), 1.0))


def shares(rig: RigFile, s: Stand) -> Array:
    """What each axis carries of the weight, N."""
    if not facts.stated(rig):
        up = np.array([*stations(rig).up, 0.0, 0.0])
        return np.asarray(np.linalg.solve(s.axes.T, s.mass * rig.site.gravity.value * up))
    lean, whole = rig.machine["radial_axes"].value, s.mass * rig.site.gravity.value
    inboard, outboard = whole * s.l_oa / (s.l_ia + s.l_oa), whole * s.l_ia / (s.l_ia + s.l_oa)
    along = np.array([math.cos(lean), math.sin(lean)])
    return np.concatenate([inboard * along, outboard * along])
