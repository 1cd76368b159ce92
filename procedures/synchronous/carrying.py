"""What the axes of a shaft's bearings carry of its weight."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, propagate_stacked
from procedures.amb_rotor.stations import stations
from procedures.synchronous import facts, runout
from procedures.synchronous.runout import Stand

Array = npt.NDArray[np.float64]
CARRIED = 0.5  # of the share of the weight that an axis should carry: how far its coils may be off
TIMES_U = 3.0  # of its own standard uncertainty
HANGS = 0.05  # of the weight: an axis that carries less is not held against its currents


def carried(rig: RigFile, inputs: Mapping[str, Estimate], means: Array) -> Array:
    """(4,): by their currents, what the coils carry of what they should of the weight, with what is known of the stand
    (`inputs` of `Stand.of`); 1 where that is next to nothing, or where what is known explains it: an axis of a shaft that all
    but stands carries a few newtons, and as much comes of a magnetic centre that is 10 µm off."""
    s = Stand.of({name: e.value for name, e in inputs.items()})
    due = shares(rig, s)
    some = np.abs(due) > HANGS * s.mass * rig.site.gravity.value
    found = np.asarray(np.where(some, runout.mean_forces(s, means) / np.where(some, due, 1.0), 1.0))
    if np.abs(found - 1).max() <= CARRIED:
        return found

    def model(v: dict[str, Array]) -> dict[str, Array]:
        return {str(k): x for k, x in enumerate(runout.mean_forces(Stand.of(v), means).T)}

    u = np.array([e.u for e in propagate_stacked(model, inputs).values()])
    return np.where(np.abs(found - 1) > np.maximum(CARRIED, TIMES_U * u / np.where(some, np.abs(due), 1.0)), found, 1.0)


def shares(rig: RigFile, s: Stand) -> Array:
    """What each axis carries of the weight, N."""
    if not facts.stated(rig):
        up = np.array([*stations(rig).up, 0.0, 0.0])
        return np.asarray(np.linalg.solve(s.axes.T, s.mass * rig.site.gravity.value * up))
    lean, whole = rig.machine["radial_axes"].value, s.mass * rig.site.gravity.value
    inboard, outboard = whole * s.l_oa / (s.l_ia + s.l_oa), whole * s.l_ia / (s.l_ia + s.l_oa)
    along = np.array([math.cos(lean), math.sin(lean)])
    return np.concatenate([inboard * along, outboard * along])
