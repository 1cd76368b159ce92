"""What makes the force of a small current another share of what a controller's map says than that of a great one.

A force that is known by a load, or by an inertia, tells what a newton of the map is at its own size. Amplifiers go by their
current sensors, whose offsets are more of a small current; and iron saturates at another current than the map has. Both are
influences, and what they do to the force of every sample is told here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Influence
from procedures.shared.certificates import certified

Array = npt.NDArray[np.float64]
SQUARE = "reluctance"  # of a motor's kind: force goes with the square of currents
SATURATES = "current at which iron saturates"


def currents(rig: RigFile) -> dict[str, int]:
    """Channels of the motors' currents whose sensors have certificates, with the power by which force goes with them."""
    motors = rig.motors.values()
    return {c: 2 if SQUARE in m.kind else 1 for m in motors for c in m.currents if c in rig.sensors}


def saturation(rig: RigFile) -> float:
    """Current at which iron saturates by the controller's map, A; 0 where it has none."""
    found = rig.parameters.get(rig.capabilities.model.get("map_saturation", ""))
    return 0.0 if found is None or not currents(rig) else found.default


def doubts(rig: RigFile, saturation_share: float) -> list[Influence]:
    """Offsets of current sensors, A; saturation, as a share of its current, to `saturation_share` of it (half width)."""
    out: list[Influence] = []
    for channel in currents(rig):
        offset = rig.sensors[channel].offset
        out += certified(f"sensors/{channel}/offset", offset, f"offset of {channel}").sensitivities
    if saturation(rig):
        u, source = saturation_share / math.sqrt(3), "saturation_share of the plan"
        out.append(Influence("map/saturation", SATURATES, u, "1", "B", "rectangular", source=source))
    return out


def moves(rig: RigFile, data: Mapping[str, Array], force: Array) -> Array:
    """How much what truly acts is more where each of `doubts` is more by one, (k, n); `force` (n,) by the map.

    Phases share a force by the squares of their currents, so that one with i has n F i/sum i^2 per ampere. Of saturation:
    i^2/2 (1 - i^2/(4 i_s^2)) is by i^2/(2 i_s^2) of itself more for a share of i_s.
    """
    powers = currents(rig)
    i = np.array([data[c] for c in powers]).reshape(len(powers), len(force))
    each = np.array(list(powers.values())).reshape(-1, 1)
    square = np.maximum((i**2).sum(axis=0), 1e-12)
    rows = [-each * i * force / square]
    if limit := saturation(rig):
        rows.append((force * (i**4).sum(axis=0) / square / (2 * limit**2))[None])
    return np.concatenate(rows) if powers else np.zeros((0, len(force)))
