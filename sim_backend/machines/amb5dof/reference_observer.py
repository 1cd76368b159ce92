"""The two observers of the AMB stand in plain Python: the disturbances inside (gains by numpy's own pole placement), and
T (3.6) with (3.13) as printed."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field

import numpy as np

from sim_backend.machines.amb5dof.params import AmbControl
from sim_backend.machines.amb5dof.reference import TICK_S, Array, Vector
from sim_backend.machines.amb5dof.reference_law import Model

CONSTANT, HARMONIC = 1, 2


def transition(omega: float) -> Array:
    """Exact step over a tick of free motion, rate, constant acceleration; synchronous displacement, its quadrature."""
    t, c, s = TICK_S, math.cos(omega * TICK_S), math.sin(omega * TICK_S)
    phi = np.zeros((5, 5))
    phi[:3, :3] = np.array([[1, t, t * t / 2], [0, 1, t], [0, 0, 1]])
    phi[3:, 3:] = np.array([[c, s], [-s, c]])
    return phi


def poles(c: AmbControl, omega: float) -> list[complex]:
    """Where the estimation error's poles are put, in the z plane; the last two only while the synchronous part is on."""
    v = (1 + 1j) * c.observer_velocity
    h = (c.observer_damping + 1j * c.observer_turning) * omega
    return [cmath.exp(-p * TICK_S) for p in (c.observer_constant, v, v.conjugate(), h, h.conjugate())]


def place(c: AmbControl, omega: float) -> Array:
    """Correction gains (5,) by Ackermann's formula in scaled states: p(Phi) O^-1 e_n, moved behind the step."""
    on = omega > c.observer_speed
    n = 5 if on else 3
    scale = np.array([1, TICK_S, TICK_S**2, 1, 1])[:n]
    phi = transition(omega)[:n, :n] / scale[None, :] * scale[:, None]
    out = np.array([1.0, 0, 0, 1, 0])[:n] / scale
    rows, last = [out], np.zeros(n)
    for _ in range(n - 1):
        rows.append(rows[-1] @ phi)
    last[-1] = 1.0
    wanted = np.eye(n, dtype=complex)
    for z in poles(c, omega)[:n]:
        wanted = wanted @ (phi - z * np.eye(n))
    gains = np.zeros(5)
    gains[:n] = np.linalg.solve(phi, (wanted @ np.linalg.solve(np.array(rows), last)).real) / scale
    return gains


def lead(c: AmbControl, omega: float) -> complex:
    """What a synchronous command must be multiplied with: the inverse of delay, hold and current loop at `omega`."""
    jw = 1j * omega
    hold = (1 - cmath.exp(-jw * TICK_S)) / (jw * TICK_S)
    return 1 / (cmath.exp(-jw * TICK_S) * hold / (1 + jw / c.model_rate))


@dataclass
class Estimate:
    """Of y, z, psi, theta (4,): rates; accelerations to work against; the synchronous ones apart, as they are and as they
    must be commanded for delay, hold and current loops."""

    rate: Array
    against: Array = field(default_factory=lambda: np.zeros(4))
    wave: Array = field(default_factory=lambda: np.zeros(4))
    ahead: Array = field(default_factory=lambda: np.zeros(4))


class Observer:
    """Estimates of y, z, psi, theta, one after the other, the gyroscopic terms by the last estimates of the rates."""

    def __init__(self, c: AmbControl, model: Model) -> None:
        self.model, self.literal = model, c.observer == 2
        self.coil = np.zeros(10)
        self.x: Array | None = None
        self.input = np.zeros(4)
        self.omega = -1.0
        self.gain = np.zeros(5)

    def __call__(self, c: AmbControl, q: Array, omega: float, sent: Array, waiting: Array) -> Estimate:
        """`sent` references act, `waiting` will next."""
        self.coil = sent + (self.coil - sent) * math.exp(-c.model_rate * TICK_S) if self.x is not None else sent.copy()
        before = (
            np.zeros(4) if self.x is None else self.x[:, 1] + (0 if self.literal else max(self.omega, 0) * self.x[:, 4])
        )
        a = self._accelerations(q, waiting if self.literal else self.coil, before, omega)
        if self.x is None:
            self.x, self.input = np.zeros((4, 5)), a
            self.x[:, 0] = q[1:]
        if self.literal:
            return self._literal(c, q[1:], a, omega)
        if self.omega < 0 or abs(omega - self.omega) > 2e-4 * self.omega:
            self.omega, self.gain = omega, place(c, omega)
        return self._inside(c, q[1:], a)

    def _accelerations(self, q: Array, coil: Array, rate: Array, omega: float) -> Array:
        m, c = self.model, self.model.c
        iy, iz, oy, oz = m.forces(q, coil)
        fcy, fcz = m.coupling(q)
        i, o, jxw = c.model_l_ia + q[0], c.model_l_oa - q[0], c.model_polar * omega
        y = (iy + oy + fcy) / c.model_mass + c.model_gravity_y
        z = (iz + oz + fcz) / c.model_mass + c.model_gravity_z
        psi = (i * iz - o * oz + c.model_l_c * fcz - jxw * rate[3]) / c.model_inertia
        theta = (o * oy - i * iy - c.model_l_c * fcy + jxw * rate[2]) / c.model_inertia
        return np.array([y, z, psi, theta])

    def _inside(self, c: AmbControl, q: Array, a: Array) -> Estimate:
        assert self.x is not None
        t, w, on = TICK_S, self.omega, self.omega > c.observer_speed
        x = self.x @ transition(w).T
        x[:, 0] += t * t * (2 * self.input + a) / 6  # the known acceleration in a straight line over the tick
        x[:, 1] += t * (self.input + a) / 2
        if not on:
            x[:, 3:] = 0
        x += np.outer(q - x[:, 0] - x[:, 3], self.gain)
        self.x, self.input = x, a
        bits, out = int(c.compensate), Estimate(x[:, 1] + w * x[:, 4])
        if bits & CONSTANT:
            out.against += x[:, 2]
        if bits & HARMONIC and on:  # displacement s = Im of (c + j s); its acceleration is -w^2 s
            phasor = x[:, 4] + 1j * x[:, 3]
            out.wave, out.ahead = -(w**2) * phasor.imag, -(w**2) * (phasor * lead(c, w)).imag
        return out

    def _literal(self, c: AmbControl, q: Array, a: Array, w: float) -> Estimate:
        assert self.x is not None
        on, h = w > c.observer_speed, self._printed_gains(c, w)
        for k in range(4):
            x = self.x[k]
            for _ in range(2):  # midpoint rule in half ticks
                half = TICK_S / 2
                mid = x + half / 2 * self._printed(x, h, w, q[k], a[k])
                x = x + half * self._printed(mid, h, w, q[k], a[k])
            if not on:
                x[3:] = 0
            self.x[k] = x
        bits, out = int(c.compensate), Estimate(self.x[:, 1].copy())
        if bits & CONSTANT:
            out.against += self.x[:, 2] + h[0] * self.x[:, 1]
        if bits & HARMONIC and on:
            out.against += self.x[:, 3] + h[1] * self.x[:, 1]
        return out

    @staticmethod
    def _printed_gains(c: AmbControl, w: float) -> Vector:
        """h1, h2, h3 under T (3.15), of the polynomial with the poles -constant and -(damping +- j turning) w."""
        if w <= c.observer_speed:
            return c.observer_constant, 0.0, 0.0
        h = complex(c.observer_damping, c.observer_turning) * w
        _, l2, l1, l0 = np.poly([-c.observer_constant, -h, -h.conjugate()]).real
        return l0 / w**2, l2 - l0 / w**2, l1 - w**2

    @staticmethod
    def _printed(x: Array, h: Vector, w: float, q: float, a: float) -> Array:
        """T (3.6) with poles -3500, -4500 and (3.13), per unit of mass."""
        h1, h2, h3 = h
        y, v, z1, z2, z3 = x
        z_dot = np.array([[-h1, -h1, 0], [-h2, -h2, 1], [-h3, -(h3 + w**2), 0]]) @ (z1, z2, z3)
        by_v = (h1**2 + h1 * h2, h1 * h2 + h2**2 - h3, h1 * h3 + h2 * (h3 + w**2))
        z_dot -= np.array(by_v) * v + np.array(h) * a
        return np.array([v + 8000 * (q - y), a + 15.75e6 * (q - y), *z_dot])
