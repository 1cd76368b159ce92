"""The linear-rotary actuator's plant once more, slowly and by other means: every coil by its flux, forces as derivatives of
what the fluxes hold, a fine step of Runge and Kutta instead of matrices. It has no dq systems, and is the core's oracle.

    lambda_k = Psi cos(8 angle - phi_0 + 120 k) + Psi_b (x cos(8 angle - phi_0 + 60 k) - y sin(8 angle - phi_0 + 60 k))
    lambda_L = Psi_l cos(2 pi z/tau - theta_0 + 120 k)

with Psi = K_R/24, Psi_b = K_B/3, Psi_l = K_L tau/(3 pi) (b leads a: L's figure 2). What turns and moves takes i d(lambda)."""

from __future__ import annotations

from typing import Final

import numpy as np

from sim_backend.core.plant import Array
from sim_backend.machines.lira.params import PlantParams

STARS: Final = ((0, 2, 4), (1, 3, 5), (6, 8, 10), (7, 9, 11), (12, 13, 14))
THIRD: Final = 2 * np.pi / 3


def fluxes(p: PlantParams, q: Array) -> Array:
    """Flux of the magnets in every coil (15,), Wb, at a place (x, y, alpha, beta, z, angle)."""
    out = np.empty(15)
    for a, side in enumerate((1, -1)):
        lever = side * p.bearing_plane - (q[4] - p.middle)
        x, y = q[0] + q[3] * lever, q[1] - q[2] * lever
        phi, k = 8 * q[5] - p.zero_ra[a], np.arange(6)
        bearing = x * np.cos(phi + k * THIRD / 2) - y * np.sin(phi + k * THIRD / 2)
        out[6 * a : 6 * a + 6] = (
            p.torque_constant[a] / 24 * np.cos(phi + k * THIRD) + p.bearing_constant[a] / 3 * bearing
        )
    theta = 2 * np.pi * q[4] / p.pair_pitch - p.zero_la
    out[12:] = p.force_constant * p.pair_pitch / (3 * np.pi) * np.cos(theta + np.arange(3) * THIRD)
    return out


def slopes(p: PlantParams, q: Array) -> Array:
    """d fluxes/d place (15, 6), by central differences: exact to some 1e-10 of their size."""
    steps = np.array([1e-5, 1e-5, 1e-4, 1e-4, 1e-6, 1e-5])
    return np.array([(fluxes(p, q + d) - fluxes(p, q - d)) / (2 * d.sum()) for d in np.diag(steps)]).T


def stored(p: PlantParams, q: Array) -> float:
    """Potential energy of magnets' pull, cogging and weight, J."""
    out = p.mass * p.gravity * q[1]
    for a, side in enumerate((1, -1)):
        lever = side * p.bearing_plane - (q[4] - p.middle)
        x, y = q[0] + q[3] * lever + p.centre[a], q[1] - q[2] * lever + p.centre[2 + a]
        out -= 0.5 * p.pull[a] * (x * x + y * y)
        out -= p.cogging_torque / 96 * np.cos(48 * q[5] - 6 * p.zero_ra[a])
    theta = 2 * np.pi * q[4] / p.pair_pitch - p.zero_la
    return float(out - p.cogging_force * p.pair_pitch / (4 * np.pi) * np.cos(2 * theta))


def inertia(p: PlantParams) -> Array:
    """Of x, y, alpha, beta, z and the angle, (6,)."""
    return np.array([p.mass, p.mass, p.transverse_inertia, p.transverse_inertia, p.mass, p.polar_inertia])


def moved(p: PlantParams, v: Array) -> float:
    """Kinetic energy, J."""
    return float(0.5 * (inertia(p) * v * v).sum())


def rates(p: PlantParams, state: Array, sent: Array) -> Array:
    """Rates of place (6), its rates (6), inductor currents, capacitor and damper voltages, coil currents (15 each)."""
    q, v = state[:6], state[6:12]
    bridge, u, damper, coil = state[12:].reshape(4, 15)
    slope = slopes(p, q)
    emf = slope @ v
    steps = np.array([1e-6, 1e-6, 1e-5, 1e-5, 1e-6, 1e-5])
    force = slope.T @ coil
    force -= np.array([(stored(p, q + d) - stored(p, q - d)) / (2 * d.sum()) for d in np.diag(steps)])
    spin = -p.polar_inertia * v[5]  # the angle counts from y to x
    force[2] -= spin * v[3]
    force[3] += spin * v[2]
    f_l, f_c, r_d, r = (np.array(x) for x in (p.filter_l, p.filter_c, p.damper_r, p.coil_r))
    through = (u - damper) / r_d
    inductance, lack = np.array(p.coil_l), u - r * coil - emf
    for star in (list(s) for s in STARS):
        lack[star] -= (lack[star] / inductance[star]).sum() / (1 / inductance[star]).sum()
    return np.concatenate([
        v, force / inertia(p), (sent - p.filter_r * bridge - u) / f_l, (bridge - coil - through) / f_c,
        through / np.array(p.damper_c), lack / inductance,
    ])  # fmt: skip


def advanced(p: PlantParams, state: Array, sent: Array, seconds: float, steps: int) -> Array:
    """The state after a time with what is sent held, by Runge and Kutta's fourth order."""
    h = seconds / steps
    for _ in range(steps):
        a = rates(p, state, sent)
        b = rates(p, state + h / 2 * a, sent)
        c = rates(p, state + h / 2 * b, sent)
        state = state + h / 6 * (a + 2 * b + 2 * c + rates(p, state + h * c, sent))
    return state
