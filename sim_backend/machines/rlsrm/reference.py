"""The rotary-linear motor once more, slowly and by other means; it is the core's oracle.

The map here is flux, with harmonics by their own cosines; co-energy is the integral of flux over current by Gauss and Legendre,
force and torque are its differences; a current is what root finding gives for its flux, steps are Runge and Kutta's of fourth
order in flux linkage. Friction is the least of a convex function, the distribution a linear programme over all six phases,
which knows nothing of pairs.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.optimize import brentq, linprog, minimize

from sim_backend.core.plant import Array
from sim_backend.machines.rlsrm.params import DEG, Map, PlantParams

ALIGNED: Final = tuple((60 * k % 90) * DEG for k in range(3))
"""A stator's poles stand every 60 degrees, a rotor's every 90."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)


def overlap(m: Map, side: int, x: float) -> float:
    """How much of a stack the mover is in, m; the ends are rounded by the stray field."""
    o = m.overlap + side * (x - m.centre)
    return float(0.5 * (m.length + np.hypot(o, m.fringe) - np.hypot(o - m.length, m.fringe)))


def per_length(m: Map, phase: int, angle: float) -> float:
    """Inductance per metre of overlap without saturation, H/m."""
    d = angle - ALIGNED[phase % 3] - m.zero[phase // 3]

    def h(a: float) -> float:
        return float(np.cos(4 * a) + m.c2 * np.cos(8 * a) + m.c3 * np.cos(12 * a))

    f = (h(d) - h(np.pi / 4)) / (h(0) - h(np.pi / 4))
    even = 1 + m.uneven * np.cos(angle - m.uneven_phase)
    return float(m.slope * m.gain[phase] * (m.unaligned + (1 - m.unaligned) * f) * even)


def flux(m: Map, phase: int, x: float, angle: float, current: float) -> float:
    """Linked flux of a phase, Wb."""
    g = overlap(m, 2 * (phase // 3) - 1, x) * per_length(m, phase, angle)
    return float(m.leakage * current + g * current / np.sqrt(1 + (current / m.saturation) ** 2))


def coenergy(m: Map, phase: int, x: float, angle: float, current: float) -> float:
    """Integral of flux over current, J."""
    return (
        0.5
        * current
        * sum(w * flux(m, phase, x, angle, 0.5 * current * (1 + n)) for n, w in zip(NODES, WEIGHTS, strict=True))
    )


def pulls(m: Map, phase: int, x: float, angle: float, current: float) -> tuple[float, float]:
    """Force and torque of a phase: slopes of the co-energy at a constant current, N and N m."""
    e = 2e-5

    def slope(dx: float, da: float) -> float:
        near, far = (coenergy(m, phase, x + s * dx, angle + s * da, current)
                     - coenergy(m, phase, x - s * dx, angle - s * da, current) for s in (1, 2))  # fmt: skip
        return (8 * near - far) / (12 * e)

    return slope(e, 0.0), slope(0.0, e)


def current_of(m: Map, phase: int, x: float, angle: float, linked: float) -> float:
    """The current at a linked flux, A."""
    if linked == 0:
        return 0.0
    return float(brentq(lambda i: flux(m, phase, x, angle, i) - linked, -100.0, 100.0, xtol=1e-13, rtol=1e-14))


def rates(p: PlantParams, state: Array, volts: Array) -> Array:
    """Rates of x, angle, their rates and six linked fluxes, (10,): without friction of the bearing's balls, off the bumpers."""
    x, angle = float(state[0]), float(state[1])
    force, torque, change = p.push[0], p.push[1], np.zeros(6)
    for k in range(6):
        i = current_of(p.map, k, x, angle, float(state[4 + k]))
        change[k] = volts[k] - p.resistance[k] * i
        if i:
            f, t = pulls(p.map, k, x, angle, i)
            force, torque = force + f, torque + t
    a = [(force - p.viscous[0] * state[2]) / p.mass, (torque - p.viscous[1] * state[3]) / p.inertia]
    return np.array([state[2], state[3], *a, *change])


def advanced(p: PlantParams, state: Array, volts: Array, seconds: float, steps: int) -> Array:
    """The state after a time with voltages held."""
    h = seconds / steps
    for _ in range(steps):
        a = rates(p, state, volts)
        b = rates(p, state + h / 2 * a, volts)
        c = rates(p, state + h / 2 * b, volts)
        state = state + h / 6 * (a + 2 * b + 2 * c + rates(p, state + h * c, volts))
    return state


def stored(m: Map, x: float, angle: float, currents: Array) -> float:
    """Energy of the field, J: psi i less the co-energy."""
    return sum(
        flux(m, k, x, angle, float(i)) * float(i) - coenergy(m, k, x, angle, float(i)) for k, i in enumerate(currents)
    )


def rubbed(p: PlantParams, rates_before: Array, force: Array, seconds: float) -> Array:
    """Rates after a kick with Coulomb friction along the surface: the least of M/2 |v - v_0|^2 + h coulomb |s|, in which v_0 is
    what there would be without it. The balls take from the shaft what costs least."""
    inertia = np.array([p.mass, p.inertia])
    free = rates_before + seconds * force / inertia
    arm, scale = np.array([1.0, p.bearing_radius]), np.sqrt(inertia)

    def cost(y: Array) -> float:
        v = y / scale
        return float(0.5 * ((y - scale * free) ** 2).sum() + seconds * p.coulomb * np.linalg.norm(arm * v))

    tried = [minimize(cost, scale * free * s, method="Nelder-Mead",
                      options={"xatol": 1e-13, "fatol": 1e-18, "maxiter": 4000}) for s in (1.0, 0.3)]  # fmt: skip
    best = min(tried, key=lambda r: float(r.fun))
    return np.zeros(2) if cost(np.zeros(2)) <= best.fun else np.asarray(best.x) / scale


def least_q(along: Array, around: Array, force: float, torque: float) -> Array | None:
    """q of six phases with the least sum that give force and torque, none below zero; None: there are none."""
    weigh = np.array([along, around / 0.02])
    found = linprog(np.ones(6), A_eq=weigh, b_eq=[force, torque / 0.02], bounds=(0, None), method="highs")
    return np.asarray(found.x) if found.success else None
