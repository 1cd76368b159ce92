"""The readable reference of the TSBS rig: the same equations as the C core, written to be read, noise-free and slow.

It is the oracle of the core (tests hold both together to 1e-6) and is itself held against an adaptive integrator. T is
the thesis; x horizontal, y up; planes are signed distances from the centre of mass, outboard positive.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim_backend.machines.tsbs.params import PlantParams

Array = npt.NDArray[np.float64]
Vector = Sequence[float] | Array
TICK_S = 1e-4


def harmonics(amplitudes: tuple[float, ...], phases: tuple[float, ...], angle: float) -> tuple[float, float]:
    """Runout at an angle: sum a_n cos(n angle + p_n) on the x axis and the same with sin on the y axis, n = 1..4."""
    terms = [(a, (n + 1) * angle + p) for n, (a, p) in enumerate(zip(amplitudes, phases, strict=True))]
    return sum(a * math.cos(t) for a, t in terms), sum(a * math.sin(t) for a, t in terms)


def amb_force(beta: float, gap: float, xi: float, positive: float, negative: float) -> float:
    """T (2.4): two opposing coils; below a gap of 0.2 mm the iron saturates."""
    return beta * (positive**2 / max(gap - xi, 2e-4) ** 2 - negative**2 / max(gap + xi, 2e-4) ** 2)


@dataclass(frozen=True)
class Lever:
    """What hangs on the lever at one instant: its weight N, the moment of that about the shaft N m (positive: the left end
    is pulled down), how far the lever has slipped rad; and the inertia kg m^2 that it and a ring add to the shaft's."""

    weight: float = 0.0
    moment: float = 0.0
    slip: float = 0.0
    inertia: float = 0.0


EMPTY = Lever()


@dataclass
class Loads:
    """What acts on the mechanics besides its state: true currents (10,), (4,) complex in the stator's frame, hysteresis
    lag (4,), hung mass kg and its weight N, the external drive and the lever; `held` are the coil currents (10,) at the start
    of the tick, by which the drag goes."""

    coil: Vector
    segment: Sequence[complex]
    play: Vector
    hung_mass: float = 0.0
    weight: float = 0.0
    drive: Drive | None = None
    lever: Lever = EMPTY
    held: Vector | None = None


@dataclass(frozen=True)
class Drive:
    """An external drive at one instant: the speed it is to hold in rad/s, its gain N m s/rad and its limit N m."""

    speed: float
    gain: float
    limit: float

    def torque(self, spin: float) -> float:
        """What it gives at a shaft speed, N m."""
        return min(max(self.gain * (self.speed - spin), -self.limit), self.limit)


SEGMENTS = (1j, -1 + 0j, -1j, 1 + 0j)
"""Where segments 1 to 4 push for a positive current, as x + j y: up, left, down, right (T 6.9)."""


def stator(p: PlantParams, along: Sequence[complex], gamma: float, theta: float) -> list[complex]:
    """Segment currents in the stator's frame, of those along and across a field turned by gamma at a rotor's angle."""
    turn = cmath.exp(1j * p.pole_pairs * (theta + gamma - p.gamma_zero))
    return [turn * i for i in along]


def motor(p: PlantParams, x: float, y: float, theta: float, segment: Sequence[complex]) -> tuple[float, float, float]:
    """Forces N and torque N m of the motor, displaced by x and y from its magnetic centre: T (5.25) for currents of any phase.

    `segment` (4,) A in the stator's frame; in the rotor's s = S exp(-j M theta) = q + j d. With q = i cos(M gamma) and
    d = i sin(M gamma) of a field turned by gamma, forces and torque are T (6.5), which is linear in the current. At gamma = 0
    this is T (5.25) less its terms 7 to 9, with beta_4 of the text below. Under the integral of T (6.1) stands
    sin u sin(u - M gamma) with u = M (Phi - theta), which is [cos(M gamma) - cos(P Phi - (P theta + M gamma))] / 2: the
    ripple goes with P theta + M gamma, i cos(P theta + M gamma) = Re(s exp(j P theta)).
    """
    wired = [segment[k] for k in ((1, 0, 2, 3) if p.exchange_segments else range(4))]
    poles, mean, pushed, force = 2 * p.pole_pairs, 0j, 0j, p.alpha_x * complex(x, y)
    for gain, current, way in zip(p.segment_gain, wired, SEGMENTS, strict=True):
        s = gain * current * cmath.exp(-1j * p.pole_pairs * theta)
        ripple = s * cmath.exp(1j * poles * theta)
        direct, cross = p.alpha_d * s.real - p.alpha_2 * ripple.real, p.alpha_c * s.imag + p.alpha_3 * ripple.imag
        force += way * complex(direct, cross) / 2 - 1j * way * p.alpha_6 * abs(s) ** 2 / 4
        pushed += way * s.real / 2
        mean += s / 4
    force += 1j * p.alpha_4 * mean.real * complex(x, y)
    torque = p.alpha_tau * mean.real + p.beta_4 * (mean * cmath.exp(3j * poles * theta)).real
    return force.real, force.imag, torque + p.beta_2 * (x * pushed.imag - y * pushed.real)


def friction(p: PlantParams, spin: float, u: Loads) -> float:
    """Torque N m against the spin: a drag of which a share goes with the square of the flux of each radial axis (eddy
    currents; `viscous` is for 3 A), smoothed Coulomb friction, and a brake that works while no drive drives."""
    held = u.coil if u.held is None else u.held
    square = sum(((held[2 * a] + held[2 * a + 1]) / 2) ** 2 for a in range(4)) / 4
    dry = p.coulomb + (0.0 if u.drive else p.brake)
    slow = spin / p.coulomb_speed
    return p.viscous * (1 - p.drag_share + p.drag_share * square / 9) * spin + dry * slow / math.sqrt(1 + slow**2)


def derivative(p: PlantParams, s: Array, u: Loads) -> Array:
    """Rates of s = (x, y, z, phi, psi, theta, their rates, height and speed of the hung mass), (14,)."""
    x, y, z, phi, psi, theta, vx, vy, vz, wphi, wpsi, spin, hung, hung_rate = s = s.tolist()  # plain floats, faster
    forces: list[tuple[float, float, float]] = []  # plane, Fx, Fy
    torque = 0.0
    for b in (0, 1):
        plane = p.z_amb[b]
        rx, ry = harmonics(p.runout[4 * b : 4 * b + 4], p.runout_phase[4 * b : 4 * b + 4], theta)
        i, lag = u.coil[4 * b : 4 * b + 4], u.play[2 * b : 2 * b + 2]
        xi, eta = x + plane * psi + p.offset_x[b] + rx, y - plane * phi + p.offset_y[b] + ry  # T (6.7)
        forces.append((plane,
                       amb_force(p.beta[b] * (1 + p.asymmetry[b]), p.gap[b], xi, i[0] - lag[0], i[1] + lag[0]),
                       amb_force(p.beta[b], p.gap[b], eta, i[2] - lag[1], i[3] + lag[1])))  # fmt: skip
        contact, drag = touchdown(p, b, s)
        forces.append(contact)
        torque += drag
    mx, my = x + p.z_motor * psi + p.motor_x, y - p.z_motor * phi + p.motor_y
    *pushed, turned = motor(p, mx, my, theta, u.segment)
    forces.append((p.z_motor, pushed[0], pushed[1]))
    torque += turned - friction(p, spin, u) - p.detent * math.sin(16 * theta + p.detent_phase)
    torque += u.drive.torque(spin) if u.drive else 0.0
    down = math.sin(p.tilt), -math.cos(p.tilt)
    torque += u.lever.moment * math.cos(theta + u.lever.slip)
    forces.append((p.z_lever, u.lever.weight * down[0], u.lever.weight * down[1]))
    polar = p.polar_inertia + u.lever.inertia
    rate = 0.0
    if u.hung_mass > 0:
        stretch, stretch_rate = y - p.z_hook * phi - hung, vy - p.z_hook * wphi - hung_rate
        tension = max(0.0, p.strap_stiffness * stretch + p.strap_damping * stretch_rate)
        forces.append((p.z_hook, tension * down[0], tension * down[1]))
        rate = (tension - u.weight) / u.hung_mass
    unbalance = p.mass * p.eccentricity * spin**2
    at = theta + p.eccentricity_phase
    fx = sum(f[1] for f in forces) + unbalance * math.cos(at)
    fy = sum(f[2] for f in forces) + unbalance * math.sin(at)
    fz = amb_force(p.beta_z, p.gap_z, z, u.coil[8], u.coil[9])
    m_phi = sum(-f[0] * f[2] for f in forces)  # T (6.6d)
    m_psi = sum(f[0] * f[1] for f in forces)  # T (6.6e)
    return np.array([vx, vy, vz, wphi, wpsi, spin,
                     fx / p.mass + p.gravity * down[0], fy / p.mass + p.gravity * down[1], fz / p.mass,
                     (m_phi - polar * spin * wpsi) / p.inertia,
                     (m_psi + polar * spin * wphi) / p.inertia,
                     torque / polar,
                     hung_rate if u.hung_mass > 0 else 0.0, rate])  # fmt: skip


def touchdown(p: PlantParams, b: int, s: Vector) -> tuple[tuple[float, float, float], float]:
    """Force of a touchdown ring on the shaft (plane, Fx, Fy) and its torque: a damped spring with smoothed friction."""
    plane = p.z_sensor[b]
    x, y = s[0] + plane * s[4] - p.ring_x[b], s[1] - plane * s[3] - p.ring_y[b]
    r = math.hypot(x, y)
    if r <= p.clearance:
        return (plane, 0.0, 0.0), 0.0
    vx, vy, nx, ny = s[6] + plane * s[10], s[7] - plane * s[9], x / r, y / r
    push = p.ring_stiffness * (r - p.clearance) + p.ring_damping * (vx * nx + vy * ny)
    if push <= 0:
        return (plane, 0.0, 0.0), 0.0
    drag = p.ring_friction * push * math.tanh((-vx * ny + vy * nx + p.ring_radius * s[11]) / 0.01)
    return (plane, -push * nx + drag * ny, -push * ny - drag * nx), -drag * p.ring_radius
