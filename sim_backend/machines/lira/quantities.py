"""The true quantities of the linear-rotary actuator, by kind and place, by the measurands' definitions."""

from __future__ import annotations

import math

import numpy as np

from sim_backend.core.plant import Array
from sim_backend.machines.lira.params import PlantParams

POLE_PAIRS = 8
ACTUATORS = ("RA1", "RA2")
RADIAL = ("x1", "x2", "y1", "y2")


def quantities(p: PlantParams) -> dict[str, float]:
    """Constants per true ampere, zeros of the encoders as the firmware's parameters would have to be, inductances and
    resistances as means of the coils, SI. `lambda`: how fast both planes leave the middle of the pull together, 1/s, at z_mid.
    `zero_current`: what a radial probe reads there, mean over a turn: the bearings' currents hold the weight alone."""
    out = {
        "K_L@LA": p.force_constant,
        "zero@LA": p.zero_la,
        "Psi@LA": p.force_constant * p.pair_pitch / (3 * math.pi),
        "R@LA": float(np.mean(p.coil_r[12:])),
        "L@LA": float(np.mean(p.coil_l[12:])),
        "lambda": math.sqrt(sum(p.pull) / p.mass),
        "m": p.mass,
        "J": p.polar_inertia,
        "J_t": p.transverse_inertia,
        "z_mid": p.middle,
        "F_c": p.cogging_force,
        "F_c2": p.cogging_force_2,
        "T_c": p.cogging_torque,
        "U_dc": p.supply,
        "delay": p.filter_lag,
        "K_ratio@RA1/RA2": p.torque_constant[0] / p.torque_constant[1],
    }
    for k, place in enumerate(ACTUATORS):
        six = slice(6 * k, 6 * k + 6)
        out |= {
            f"K_R@{place}": p.torque_constant[k],
            f"K_B@{place}": p.bearing_constant[k],
            f"K_pull@{place}": p.pull[k],
            f"zero@{place}": p.zero_ra[k],
            f"Psi@{place}": p.torque_constant[k] / (3 * POLE_PAIRS),
            f"R@{place}": float(np.mean(p.coil_r[six])),
            f"L@{place}": float(np.mean(p.coil_l[six])),
        }
    return out | {f"zero_current@{name}": float(x) for name, x in zip(RADIAL, _read_in_the_middle(p), strict=True)}


def _read_in_the_middle(p: PlantParams) -> Array:
    """What x1, x2, y1, y2 read where both planes of the rotary actuators stand in the middle of their pull, m, (4,)."""
    share = p.sensor_plane / p.bearing_plane
    true = []
    for first, second in (p.centre[:2], p.centre[2:]):
        mean, half = -(first + second) / 2, -(first - second) / 2
        true += [mean + half * share, mean - half * share]
    read: Array = np.array(p.position_gain[:4]) * np.array(true) + np.array(p.position_offset[:4])
    return read
