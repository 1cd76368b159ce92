"""The readable reference of the AMB stand's mechanics: T (2.3) with (2.4b), noise-free and slow.

It is the oracle of the core (tests hold both together) and is itself held against an adaptive integrator. T is the thesis;
labels as corrected in the errata: psi about y, theta about z, and each axis has its own beta.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from sim_backend.machines.amb5dof.params import AmbParams

Array = npt.NDArray[np.float64]
Vector = Sequence[float] | Array
TICK_S = 1e-4
MODES = range(2)


def amb_force(beta: float, gap: float, xi: float, positive: float, negative: float) -> float:
    """T (2.4): two opposing coils; below a gap of 0.1 mm the iron saturates."""
    return beta * (positive**2 / max(gap - xi, 1e-4) ** 2 - negative**2 / max(gap + xi, 1e-4) ** 2)


def displacement(s: Vector, place: float, shape: Vector) -> tuple[float, float]:
    """y and z of the shaft at `place` m outboard of its centre of mass, where the modes have the values `shape`."""
    _, y, z, psi, theta = s[:5]
    bent_y, bent_z = shape[0] * s[12] + shape[1] * s[14], shape[0] * s[13] + shape[1] * s[15]
    return y + place * theta + bent_y, z - place * psi + bent_z


class Sum:
    """Forces and moments as they add up: on the centre of mass, about y and z, and on the modes (axis by axis for each)."""

    def __init__(self) -> None:
        self.y = self.z = self.psi = self.theta = 0.0
        self.modal = [0.0] * 4

    def push(self, place: float, shape: Vector, fy: float, fz: float) -> None:
        """A force at a place of the shaft: its arm turns y into theta and z into minus psi."""
        self.y += fy
        self.z += fz
        self.theta += place * fy
        self.psi += -place * fz
        self.modal = [m + shape[k // 2] * (fy, fz)[k % 2] for k, m in enumerate(self.modal)]


def ring(p: AmbParams, s: Vector, b: int, total: Sum) -> float:
    """Touchdown ring of bearing `b`; returns its torque on the shaft N m."""
    place, shape = (-p.l_is, p.l_os)[b], p.shape_sensor[b::2]
    y, z = displacement(s, place, shape)
    r = math.hypot(y, z)
    if r <= p.clearance:
        return 0.0
    vy, vz = s[7] + place * s[10], s[8] - place * s[9]
    push = p.ring_stiffness * (r - p.clearance) + p.ring_damping * (vy * y + vz * z) / r
    if push <= 0:
        return 0.0
    drag = p.ring_friction * push * math.tanh(((vz * y - vy * z) / r + p.ring_radius * s[11]) / 0.01)
    total.push(place, shape, (-push * y + drag * z) / r, (-push * z - drag * y) / r)
    return -drag * p.ring_radius


def unbalances(p: AmbParams, weights: Sequence[complex] = (0j, 0j)) -> list[complex]:
    """Mass times radius of each plane as y + j z on the shaft, what is mounted included."""
    own = (cmath.rect(u, a) for u, a in zip(p.unbalance, p.unbalance_phase, strict=True))
    return [u + w for u, w in zip(own, weights, strict=True)]


def derivative(
    p: AmbParams, s: Vector, coil: Vector, torque: float = 0.0, weights: Sequence[complex] = (0j, 0j)
) -> list[float]:
    """Right-hand side, (20,): x y z psi theta phi, their rates, bending y1 z1 y2 z2, their rates.

    Args:
        coil: ten true currents A. torque: N m of drive and Coulomb drag. weights: mounted mass times radius kg m by plane.
    """
    total, x, omega = Sum(), s[0], s[11]
    inward = (-(p.l_ia + x), p.l_oa - x)  # the AMBs' planes from the centre of mass, which moves by x
    ring_torque = 0.0
    for b, place in enumerate(inward):
        shape = p.shape_amb[b::2]
        pair = []
        for axis, at in enumerate(displacement(s, place, shape)):
            k = 2 * b + axis
            pair.append(amb_force(p.beta[k], p.gap, at + p.offset[k], coil[2 * k], coil[2 * k + 1]))
        total.push(place, shape, *pair)
        ring_torque += ring(p, s, b, total)
    y, z = displacement(s, -p.l_c, p.shape_coupling)
    stretched_y, stretched_z = y - p.coupling_offset[0], z - p.coupling_offset[1]
    total.push(-p.l_c, p.shape_coupling, -p.coupling * stretched_y, -p.coupling * stretched_z)
    spin = (torque - p.viscous * omega + ring_torque) / p.polar_inertia
    for b, u in enumerate(unbalances(p, weights)):
        turned = u * cmath.exp(1j * s[5])  # minus its acceleration times the mass: d2/dt2 of r e^(j phi)
        pull = -turned * (1j * spin - omega**2)
        total.push((-p.l_iu, p.l_ou)[b], p.shape_unbalance[b::2], pull.real, pull.imag)
    fx = amb_force(p.beta[4], p.gap_x, x, coil[8], coil[9])
    if abs(x) > p.stop:
        fx -= p.ring_stiffness * (x - math.copysign(p.stop, x)) + p.ring_damping * s[6]
    gyro = p.polar_inertia * omega
    rates = [
        fx / p.mass,
        total.y / p.mass + p.gravity_y,
        total.z / p.mass + p.gravity_z,
        (total.psi - gyro * s[10]) / p.inertia,  # (2.3d), psi about y
        (total.theta + gyro * s[9]) / p.inertia,  # (2.3e), theta about z
        spin,
    ]
    bending = []
    for k in MODES:
        w = 2 * math.pi * p.mode_hz[k]
        for axis in (0, 1):
            q, v = s[12 + 2 * k + axis], s[16 + 2 * k + axis]
            free = total.modal[2 * k + axis] / p.mode_mass[k] - 2 * p.mode_damping[k] * w * v - w**2 * q
            bending.append(free if p.mode_on[k] else 0.0)
    flexible = any(p.mode_on)
    return [*s[6:12], *rates, *(s[16:20] if flexible else (0.0,) * 4), *bending]
