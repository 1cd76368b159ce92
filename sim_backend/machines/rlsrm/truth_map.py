"""Truth of the map of inductances, as encoders read places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bench.rigfile import RigFile
from sim_backend.machines.rlsrm.params import PHASES, Map, PlantParams

Told = Mapping[tuple[str, str], float]


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
    out |= {("current_zero", name): zero for name, zero in zip(PHASES, p.current_offset, strict=True)}
    out |= {("gain", name): g / mean for name, g in zip(PHASES, m.gain, strict=True)}
    return out | {("zero", motor): m.zero[k] for k, motor in enumerate(motors)}


def of_zeros(rig: RigFile, drawn: Any) -> Told:
    """Zeros, by motor."""
    m = read_frame(drawn.plant.plant)
    return {("zero", motor): m.zero[k] for k, motor in enumerate(rig.motors)}
