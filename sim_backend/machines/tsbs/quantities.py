"""The true quantities of a machine, by the measurands' definitions and not by what estimates them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from sim_backend.machines.tsbs.params import PlantParams

Array = npt.NDArray[np.float64]
HIGH_BIAS_A = 4.0  # the second bias at which the drag is measured


def eccentricity(p: PlantParams, angles: Array) -> Array:
    """Vertical distance of each journal from its magnetic centre, (2, n) m, with the sensors reading zero."""
    n = np.arange(1, 5)[:, None]

    def quadrature(amplitudes: tuple[float, ...], phases: tuple[float, ...]) -> Array:
        a, q = np.array(amplitudes)[:, None], np.array(phases)[:, None]
        out: Array = (a * np.sin(n * angles + q)).sum(axis=0)
        return out

    sensed = [
        -quadrature(p.target[4 * b : 4 * b + 4], p.target_phase[4 * b : 4 * b + 4])
        - p.position_offset[1 + 2 * b] / p.position_gain[1 + 2 * b]
        for b in (0, 1)
    ]
    span = p.z_sensor[1] - p.z_sensor[0]
    out = []
    for b in (0, 1):
        share = (p.z_amb[b] - p.z_sensor[0]) / span
        plane = sensed[0] + share * (sensed[1] - sensed[0])
        out.append(plane + p.offset_y[b] + quadrature(p.runout[4 * b : 4 * b + 4], p.runout_phase[4 * b : 4 * b + 4]))
    return np.array(out)


def quantities(p: PlantParams, bias_A: tuple[float, ...]) -> dict[str, float]:
    """K, K2 and the tangent at own weight, by the measurand's definition (see `procedures.amb_calibration`)."""
    angles = np.linspace(0, 2 * math.pi, 720, endpoint=False)
    xi = eccentricity(p, angles)
    beta, gap, bias = (np.array(x)[:, None] for x in (p.beta, p.gap, bias_A))
    near, far = beta / (gap - xi) ** 2, beta / (gap + xi) ** 2
    k, k2 = 2 * bias * (near + far), near - far
    force = own_weight(p, angles)
    slope = np.sqrt(k**2 - 4 * k2 * (k2 * bias**2 - force))  # on F = K2 (b^2 + i^2) + K i
    out: dict[str, float] = {}
    for b, name in enumerate("io"):
        out |= {
            f"K_{name}": float(k[b].mean()),
            f"K2_{name}": float(k2[b].mean()),
            f"Kw_{name}": float(slope[b].mean()),
        }
    return out | motor_quantities(p, bias_A)


def motor_quantities(p: PlantParams, bias_A: tuple[float, ...]) -> dict[str, float]:
    """The motor's and the shaft's constants by their measurands' definitions: per true ampere of the segments, at gamma = 0
    as commutated (alpha_d, mean over a turn, where the ripple vanishes) or at the home angle (the others)."""
    g, span = p.segment_gain, p.z_sensor[1] - p.z_sensor[0]
    vertical, direct = (g[0] + g[2]) / 2, p.alpha_d * math.cos(p.pole_pairs * p.gamma_zero)
    stiffness = p.alpha_x * (p.z_motor - p.z_sensor[0]) / span  # referred to the outboard sensors, T below (6.8)
    d, c = p.alpha_d - p.alpha_2, p.alpha_c + p.alpha_3

    return {
        "alpha_d": direct * vertical,
        "alpha_dx": direct * (g[1] + g[3]) / 2,
        "alpha_x_prime": stiffness,
        "alpha_x_prime_amb": stiffness,
        "alpha_ratio": d / c,
        "alpha_c": c * vertical,
        "gamma_0": p.gamma_zero,
        "gamma_0t": p.gamma_zero,
        "alpha_tau": (p.alpha_tau + p.beta_4) * sum(g) / 4,
        "B": drag_of(p, *bias_A),
        "B_high": drag_of(p, HIGH_BIAS_A),
        "T_c": p.coulomb,
        "J_z": p.polar_inertia,
    }


def drag_of(p: PlantParams, *bias_A: float) -> float:
    """Viscous drag, N m s/rad, at the biases of the radial AMBs; 0 is one that is idle."""
    return p.viscous * (1 - p.drag_share + p.drag_share * sum(b**2 for b in bias_A) / len(bias_A) / 9)


def own_weight(p: PlantParams, angles: Array) -> Array:
    """Vertical force (2, n) N of each AMB that carries the bare rotor at the sensors' zero (T 6.11, corrected)."""
    n = np.arange(1, 5)[:, None]
    sensed = []
    for b in (0, 1):
        a, q = np.array(p.target[4 * b : 4 * b + 4])[:, None], np.array(p.target_phase[4 * b : 4 * b + 4])[:, None]
        offset = p.position_offset[1 + 2 * b] / p.position_gain[1 + 2 * b]
        sensed.append(-(a * np.sin(n * angles + q)).sum(axis=0) - offset)
    share = (p.z_motor - p.z_sensor[0]) / (p.z_sensor[1] - p.z_sensor[0])
    pull = p.alpha_x * (sensed[0] + share * (sensed[1] - sensed[0]) + p.motor_y)
    total = p.mass * p.gravity * math.cos(p.tilt) - pull  # F_i + F_o; moments about the centre of mass vanish
    zi, zo = p.z_amb
    outboard = (-p.z_motor * pull - zi * total) / (zo - zi)
    return np.array([total - outboard, outboard])
