"""The TSBS rig's mechanics once more in plain Python: with `reference_loop` the oracle of the C core.

Written for the reader: one function per equation, no shortcuts, no noise, no quantisation. T is the thesis; equation
numbers are its own. Planes are signed distances zeta from the centre of mass, outboard positive. State `s`, shape
(14,): x, y, z, phi, psi, theta, their rates, height and rate of the hung mass; SI.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sim_backend.core.params import PlantParams

LEAST_GAP_M = 20e-6


@dataclass(frozen=True)
class Inputs:
    """What acts on the mechanics besides its own state: coil (10,) and segment (4,) currents in A, the hysteresis lag
    (4,) in A, the commutation angle in rad, the hung mass in kg and its weight in N."""

    coil: Sequence[float]
    segment: Sequence[float]
    play: Sequence[float] = (0.0, 0.0, 0.0, 0.0)
    gamma: float = 0.0
    hung_mass: float = 0.0
    weight: float = 0.0


@dataclass
class Wrench:
    """Sum of forces in N and of moments in N m about the centre of mass; `phi` turns about x, `psi` about y."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    phi: float = 0.0
    psi: float = 0.0
    theta: float = 0.0

    def add(self, zeta: float, fx: float, fy: float) -> None:
        """A radial force in the plane zeta: right sides of T (6.6d) and (6.6e)."""
        self.x += fx
        self.y += fy
        self.phi -= zeta * fy
        self.psi += zeta * fx


def displacement(s: Sequence[float], zeta: float) -> tuple[float, float]:
    """Radial displacement (x, y) in m of the plane zeta, T (6.7)."""
    return s[0] + zeta * s[4], s[1] - zeta * s[3]


def velocity(s: Sequence[float], zeta: float) -> tuple[float, float]:
    """Time derivative of `displacement`, m/s."""
    return s[6] + zeta * s[10], s[7] - zeta * s[9]


def runout(amplitudes: Sequence[float], phases: Sequence[float], theta: float) -> tuple[float, float]:
    """Harmonics n = 1, 2, ... of a turning surface: sum a_n cos(n theta + p_n) in x, with sine in y; m."""
    terms = [(a, n * theta + p) for n, (a, p) in enumerate(zip(amplitudes, phases, strict=True), start=1)]
    return sum(a * math.cos(q) for a, q in terms), sum(a * math.sin(q) for a, q in terms)


def amb_force(beta: float, gap: float, xi: float, i_p: float, i_n: float) -> float:
    """Force in N of an opposing pair of magnets at distance xi from its magnetic centre, T (2.4)."""
    near, far = max(gap - xi, LEAST_GAP_M), max(gap + xi, LEAST_GAP_M)
    return beta * (i_p**2 / near**2 - i_n**2 / far**2)


def bearing(p: PlantParams, b: int, s: Sequence[float], u: Inputs, w: Wrench) -> None:
    """Radial AMB `b` (0 inboard, 1 outboard) with magnetic offset, journal runout and the lag of its hysteresis."""
    part = slice(4 * b, 4 * b + 4)
    zeta, i, lag = p.z_amb[b], u.coil[part], u.play[2 * b : 2 * b + 2]
    x, y = displacement(s, zeta)
    rx, ry = runout(p.runout[part], p.runout_phase[part], s[5])
    fx = amb_force(p.beta[b], p.gap[b], x + p.offset_x[b] + rx, i[0] - lag[0], i[1] + lag[0])
    fy = amb_force(p.beta[b], p.gap[b], y + p.offset_y[b] + ry, i[2] - lag[1], i[3] + lag[1])
    w.add(zeta, fx, fy)


def motor(p: PlantParams, s: Sequence[float], u: Inputs, w: Wrench) -> None:
    """Self-bearing motor, T (6.5), with friction and detent torque; Coulomb friction is smoothed about standstill."""
    i1, i2, i3, i4 = (gain * i for gain, i in zip(p.segment_gain, u.segment, strict=True))
    ix, iy, mean = (i4 - i2) / 2, (i1 - i3) / 2, (i1 + i2 + i3 + i4) / 4
    angle = p.pole_pairs * (u.gamma - p.gamma_zero)
    c, q = math.cos(angle), math.sin(angle)
    x, y = displacement(s, p.z_motor)
    fx = p.alpha_d * c * ix - p.alpha_c * q * iy + p.alpha_x * (x + p.motor_x)
    fy = p.alpha_d * c * iy + p.alpha_c * q * ix + p.alpha_x * (y + p.motor_y)
    w.add(p.z_motor, fx, fy)
    slow = s[11] / p.coulomb_speed
    friction = p.viscous * s[11] + p.coulomb * slow / math.hypot(1, slow)
    w.theta += p.alpha_tau * c * mean - friction - p.detent * math.sin(16 * s[5] + p.detent_phase)


def touchdown(p: PlantParams, b: int, s: Sequence[float], w: Wrench) -> None:
    """Ring at sensor plane `b`: spring and damper along the normal, never pulling, and friction against the slip."""
    zeta = p.z_sensor[b]
    (x, y), (vx, vy) = displacement(s, zeta), velocity(s, zeta)
    x, y = x - p.ring_x[b], y - p.ring_y[b]
    r = math.hypot(x, y)
    if r <= p.clearance:
        return
    nx, ny = x / r, y / r
    normal = max(0.0, p.ring_stiffness * (r - p.clearance) + p.ring_damping * (vx * nx + vy * ny))
    slip = vy * nx - vx * ny + p.ring_radius * s[11]
    drag = p.ring_friction * normal * math.tanh(slip / 0.01)
    w.add(zeta, -normal * nx + drag * ny, -normal * ny - drag * nx)
    w.theta -= drag * p.ring_radius


def strap(p: PlantParams, s: Sequence[float], u: Inputs, w: Wrench) -> tuple[float, float]:
    """Hung mass on its strap, which never pushes. Returns the rates of its height and speed."""
    if u.hung_mass <= 0:
        return 0.0, 0.0
    hook, hook_rate = displacement(s, p.z_hook)[1], velocity(s, p.z_hook)[1]
    tension = max(0.0, p.strap_stiffness * (hook - s[12]) + p.strap_damping * (hook_rate - s[13]))
    w.add(p.z_hook, tension * math.sin(p.tilt), -tension * math.cos(p.tilt))
    return s[13], (tension - u.weight) / u.hung_mass


def rates(p: PlantParams, s: Sequence[float], u: Inputs) -> list[float]:
    """Right-hand side of the mechanics, 14 numbers: T (6.6) with gyroscopic moments and unbalance.

    The unbalance acts in the plane of the centre of mass; its tangential part, proportional to the angular
    acceleration, is left out.
    """
    w = Wrench()
    for b in (0, 1):
        bearing(p, b, s, u, w)
        touchdown(p, b, s, w)
    w.z = amb_force(p.beta_z, p.gap_z, s[2], u.coil[8], u.coil[9])
    motor(p, s, u, w)
    mass_rates = strap(p, s, u, w)
    spin = s[11]
    swing = p.mass * p.eccentricity * spin**2
    heavy = s[5] + p.eccentricity_phase
    return [
        *s[6:12],
        (w.x + swing * math.cos(heavy)) / p.mass + p.gravity * math.sin(p.tilt),
        (w.y + swing * math.sin(heavy)) / p.mass - p.gravity * math.cos(p.tilt),
        w.z / p.mass,
        (w.phi - p.polar_inertia * spin * s[10]) / p.inertia,
        (w.psi + p.polar_inertia * spin * s[9]) / p.inertia,
        w.theta / p.polar_inertia,
        *mass_rates,
    ]


def read_positions(p: PlantParams, s: Sequence[float]) -> list[float]:
    """What the position sensors xi, yi, xo, yo, z read in m, without noise and quantisation."""
    raw: list[float] = []
    for b in (0, 1):
        part = slice(4 * b, 4 * b + 4)
        (x, y), (rx, ry) = displacement(s, p.z_sensor[b]), runout(p.target[part], p.target_phase[part], s[5])
        pair = [x + rx, y + ry]
        raw += pair[::-1] if p.exchange_axes[b] else pair
    raw.append(s[2])
    rows = zip(raw, p.position_gain, p.position_offset, p.position_sign, strict=True)
    read = [sign * (gain * y + offset) for y, gain, offset, sign in rows]
    return [p.stuck_value if stuck else y for y, stuck in zip(read, p.stuck, strict=True)]
