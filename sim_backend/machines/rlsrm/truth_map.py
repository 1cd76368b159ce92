"""Truth of the map of inductances as encoders read places, and of where phases draw the shaft."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from bench.rigfile import RigFile
from sim_backend.machines.rlsrm.params import DEG, PHASES, Map, PlantParams
from sim_backend.machines.rlsrm.plant import slopes

Told = Mapping[tuple[str, str], float]
ALIGNED = (0.0, 60.0, 30.0)  # degrees, of A, B, C within a tooth's 90


def read_frame(p: PlantParams) -> Map:
    """The map over readings: in the mean over places an encoder reads more than is by where its edges lie."""
    along, around = (e * c for e, c in zip(p.edge, p.pitch, strict=True))
    m = p.map
    return replace(
        m, zero=(m.zero[0] + around, m.zero[1] + around), centre=m.centre + along, uneven_phase=m.uneven_phase + around
    )


def of_map(rig: RigFile, drawn: Any) -> Told:
    """By quantity of `inductance-map` and where; gains relative to their mean."""
    p, motors = drawn.plant.plant, list(rig.motors)
    m, mean = read_frame(p), float(np.mean(p.map.gain))
    out = {
        ("slope", ""): m.slope * mean, ("unaligned", ""): m.unaligned, ("c2", ""): m.c2, ("c3", ""): m.c3,
        ("length", ""): m.length, ("overlap", ""): m.overlap, ("fringe", ""): m.fringe, ("leakage", ""): m.leakage,
        ("saturation", ""): m.saturation, ("centre", ""): m.centre,
        ("uneven", "cosine"): m.uneven * float(np.cos(m.uneven_phase)),
        ("uneven", "sine"): m.uneven * float(np.sin(m.uneven_phase)),
        ("give", ""): drawn.values["lock_give_angle"], ("give_x", ""): drawn.values["lock_give_x"],
    }  # fmt: skip
    out |= {("gain", name): g / mean for name, g in zip(PHASES, m.gain, strict=True)}
    return out | {("zero", motor): m.zero[k] for k, motor in enumerate(motors)}


def of_zeros(rig: RigFile, drawn: Any, amperes: float) -> Told:
    """Zeros, and by how much friction keeps the shaft from them at a current: mean of phases and teeth."""
    p, out = drawn.plant.plant, {}
    m = read_frame(p)
    for k, motor in enumerate(rig.motors):
        out["zero", motor] = m.zero[k]
        each = [_band(p, k, n, tooth, amperes) for n in range(3) for tooth in range(4)]
        out["band", motor] = float(np.mean(each))
    return out


def _band(p: PlantParams, stator: int, n: int, tooth: int, amperes: float) -> float:
    """Half of what the shaft stops apart where one phase draws against friction."""
    q = amperes**2 / (np.sqrt(1 + (amperes / p.map.saturation) ** 2) + 1)
    rubs = p.coulomb * p.bearing_radius
    at = (ALIGNED[n] + 90 * tooth) * DEG + p.map.zero[stator]

    def left(d: float, sign: int) -> float:
        return float(slopes(p.map, 0.0, at + d)[2][3 * stator + n]) * float(q) + sign * rubs

    ends = [brentq(left, -8 * DEG, 8 * DEG, args=(sign,)) for sign in (1, -1)]
    return float(0.5 * (ends[0] - ends[1]))
