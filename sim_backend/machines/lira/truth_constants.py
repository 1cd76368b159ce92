"""What the drawn machine's constants truly are, and how steep its cogging is at a place."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.quantities import ACTUATORS, POLE_PAIRS

ALONG, AROUND = "z", "gamma"
Z = 4


def along(p: PlantParams, read: float) -> float:
    """d/dz of F_c sin 2 theta + F_c2 sin 4 theta where z reads so much, N/m."""
    z = (read - p.position_offset[Z]) / p.position_gain[Z]
    turn = 2 * math.pi / p.pair_pitch
    theta = turn * z - p.zero_la
    return turn * (2 * p.cogging_force * math.cos(2 * theta) + 4 * p.cogging_force_2 * math.cos(4 * theta))


def around(p: PlantParams, angle: float) -> float:
    """d/dgamma of T_c sin 6 phi, of which each rotary actuator has half by its own phase, N m/rad."""
    turn = 6 * POLE_PAIRS
    return sum(0.5 * turn * p.cogging_torque * math.cos(6 * (POLE_PAIRS * angle - zero)) for zero in p.zero_ra)


def constants(rig: RigFile, drawn: Truth, places: Mapping[str, Sequence[float]]) -> dict[tuple[str, str, float], float]:
    """By quantity, where and place, of loops by the names of the line: 0 where there is no place."""
    del rig
    p: PlantParams = drawn.plant.plant
    out: dict[tuple[str, str, float], float] = {}
    if ALONG in places:
        out["K_force", "LA", 0.0] = p.force_constant
        out |= {("cogging_stiffness", ALONG, x): along(p, x) for x in places[ALONG]}
    if AROUND in places:
        first, other = p.torque_constant
        out |= {("K_torque", name, 0.0): k for name, k in zip(ACTUATORS, (first, other), strict=True)}
        out["inertia", AROUND, 0.0] = p.polar_inertia
        out["K_over_J", AROUND, 0.0] = (first + other) / p.polar_inertia
        out["K_ratio", "/".join(ACTUATORS), 0.0] = first / other
        out |= {("cogging_stiffness_angle", AROUND, x): around(p, x) for x in places[AROUND]}
    return out
