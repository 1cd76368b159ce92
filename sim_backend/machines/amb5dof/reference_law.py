"""The AMB stand's laws in plain Python: references, notches, PID, flatness with CCS and CAC (T 2.4, corrected)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sim_backend.core import LAND, LEVITATE, LIFT
from sim_backend.machines.amb5dof.params import AmbControl
from sim_backend.machines.amb5dof.reference import TICK_S, Array, Vector, amb_force

PID, CCS, CAC = range(3)
AXES = ("yi", "zi", "yo", "zo", "x")


def clip(value: float, low: float, high: float) -> float:
    """`value`, but not less than `low` nor more than `high`."""
    return min(max(value, low), high)


def toward(value: float, goal: float, step: float) -> float:
    """`value`, at most `step` nearer to `goal`."""
    return value + clip(goal - value, -step, step)


def ccs(force: float, beta: float, gap: float, xi: float, bias: float) -> float:
    """T (2.25) as printed, with its branch, for forces inside the corrected bounds: differential current A."""
    most = 4 * beta * bias**2
    force = clip(force, -most / (gap + xi) ** 2, most / (gap - xi) ** 2)
    if abs(xi) < 1e-9:
        return force * gap**2 / (4 * beta * bias)
    root = math.sqrt(max(force * xi * gap / beta + bias**2, 0.0))
    return clip((-(xi**2 + gap**2) * bias - (xi**2 - gap**2) * root) / (2 * xi * gap), -bias, bias)


def cac(force: float, beta: float, gap: float, xi: float, eta: float) -> tuple[float, float]:
    """T (2.22) with (2.23): both coil currents A."""
    if force >= eta:
        y = math.sqrt(force)
    elif force < -eta:
        y = 0.0
    else:
        f = force + eta
        y = 15 / 16 * eta**-2.5 * f**3 - 13 / 16 * eta**-3.5 * f**4 + 17 / 64 * eta**-4.5 * f**5 - eta**-5.5 * f**6 / 32
    root = math.sqrt(beta)
    return (gap - xi) / root * y, (gap + xi) / root * math.sqrt(max(y**2 - force, 0.0))


class Model:
    """The controller's idea of the machine: T (2.14), (2.17) and the gaps under (2.4)."""

    def __init__(self, c: AmbControl) -> None:
        self.c = c
        self.beta = [getattr(c, f"model_beta_{axis}") for axis in AXES]
        self.offset = [*(getattr(c, f"model_offset_{axis}") for axis in AXES[:4]), 0.0]
        self.gap = [*[c.model_gap] * 4, c.model_gap_x]

    def coordinates(self, at: Vector, x: float) -> Array:
        """x, y, z, psi, theta from the readings W13, V13, W24, V24, x."""
        w13, v13, w24, v24, axial = at
        inboard, outboard = self.c.model_l_is + x, self.c.model_l_os - x
        theta, psi = (w24 - w13) / (inboard + outboard), (v13 - v24) / (inboard + outboard)
        return np.array([axial, w13 + inboard * theta, v24 + outboard * psi, psi, theta])

    def planes(self, q: Vector) -> Array:
        """The readings that belong to x, y, z, psi, theta, at x = 0 (2.17)."""
        x, y, z, psi, theta = q
        i, o = self.c.model_l_is, self.c.model_l_os
        return np.array([y - i * theta, z + i * psi, y + o * theta, z - o * psi, x])

    def gaps(self, q: Vector) -> list[float]:
        """xi of each axis, from its magnetic centre."""
        x, y, z, psi, theta = q
        i, o = self.c.model_l_ia + x, self.c.model_l_oa - x
        places = (y - i * theta, z + i * psi, y + o * theta, z - o * psi, x)
        return [at + offset for at, offset in zip(places, self.offset, strict=True)]

    def coupling(self, q: Vector) -> tuple[float, float]:
        """F_c,y and F_c,z."""
        _, y, z, psi, theta = q
        return -self.c.model_coupling * (y - self.c.model_l_c * theta), -self.c.model_coupling * (
            z + self.c.model_l_c * psi
        )

    def forces(self, q: Vector, coil: Vector) -> list[float]:
        """T (2.4) of the four radial axes."""
        rows = enumerate(self.gaps(q)[:4])
        return [amb_force(self.beta[k], self.gap[k], xi, coil[2 * k], coil[2 * k + 1]) for k, xi in rows]

    def flat(self, q: Vector, rate: Vector, v: Vector, omega: float) -> list[float]:
        """T (2.14) with the labels corrected: forces of yi, zi, yo, zo, x for the accelerations `v`."""
        c, x = self.c, q[0]
        i, o = c.model_l_ia + x, c.model_l_oa - x
        fcy, fcz = self.coupling(q)
        jxw, m, j = c.model_polar * omega, c.model_mass, c.model_inertia
        _, _, _, psi_dot, theta_dot = rate
        vx, vy, vz, vpsi, vtheta = v
        gy, gz, lc = c.model_gravity_y, c.model_gravity_z, c.model_l_c
        iy = (m * o * (vy - gy) + jxw * psi_dot - j * vtheta - (o + lc) * fcy) / (i + o)
        oy = (m * i * (vy - gy) - jxw * psi_dot + j * vtheta - (i - lc) * fcy) / (i + o)
        iz = (m * o * (vz - gz) + jxw * theta_dot + j * vpsi - (o + lc) * fcz) / (i + o)
        oz = (m * i * (vz - gz) - jxw * theta_dot - j * vpsi - (i - lc) * fcz) / (i + o)
        return [iy, iz, oy, oz, m * vx]


@dataclass
class Notch:
    """(s^2 + w^2)/(s^2 + s w/Q + w^2) by the prewarped bilinear transform, direct form I; starts settled."""

    hz: float
    q: float
    past: list[float] = field(default_factory=list)

    def __call__(self, value: float) -> float:
        if self.hz <= 0:
            return value
        x1, x2, y1, y2 = self.past or [value] * 4
        g = math.tan(math.pi * self.hz * TICK_S)
        a0 = 1 + g / self.q + g * g
        b, b1, a2 = 1 + g * g, 2 * (g * g - 1), 1 - g / self.q + g * g
        y = (b * (value + x2) + b1 * (x1 - y1) - a2 * y2) / a0
        self.past = [value, x1, y, y1]
        return y


class References:
    """Set points on their way, ellipse, lift and landing: r and its first two derivatives of x, y, z, psi, theta."""

    def __init__(self, c: AmbControl, rest: Array) -> None:
        self.rest = rest
        self.set = np.array([c.ref_x, c.ref_y, c.ref_z, c.ref_psi, c.ref_theta])
        self.share = self.phase = self.clock = 0.0

    def __call__(self, c: AmbControl, mode: int) -> tuple[Array, Array, Array]:
        goal = [c.ref_x, c.ref_y, c.ref_z, c.ref_psi, c.ref_theta]
        slews = [c.slew] * 3 + [c.slew_tilt] * 2
        to = [toward(s, g, slew * TICK_S) if slew > 0 else g for s, g, slew in zip(self.set, goal, slews, strict=True)]
        v = np.array([(b - a) / TICK_S if slew > 0 else 0.0 for a, b, slew in zip(self.set, to, slews, strict=True)])
        self.set = np.array(to)
        r, a = self.set.copy(), np.zeros(5)
        self._ellipse(c, r, v, a)
        return (r, v, a) if mode == LEVITATE else self._lift(c, mode, r, v, a)

    def _ellipse(self, c: AmbControl, r: Array, v: Array, a: Array) -> None:
        """T (2.26), (3.16) by the product rule."""
        if self.share == 0 and c.ellipse_on == 0:
            return
        before, turning = self.share, 2 * math.pi * c.ellipse_hz
        self.share = toward(before, float(c.ellipse_on != 0), TICK_S / max(c.ellipse_ramp_s, TICK_S))
        self.phase += turning * TICK_S
        g, rate = self.share, (self.share - before) / TICK_S if c.ellipse_ramp_s > TICK_S else 0.0
        turn = self.phase + c.ellipse_phase, c.ellipse_ratio * self.phase + c.ellipse_phase
        w = turning * np.array([1.0, c.ellipse_ratio])
        waves = np.array([math.sin(turn[0]), math.cos(turn[1])])
        slopes = w * np.array([math.cos(turn[0]), -math.sin(turn[1])])
        size = np.array([c.ellipse_y, c.ellipse_z])
        r[1:3] += size * g * waves
        v[1:3] += size * (g * slopes + rate * waves)
        a[1:3] += size * (2 * rate * slopes - g * w * w * waves)

    def _lift(self, c: AmbControl, mode: int, r: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        t, per, sign = self.clock / c.lift_time_s, 1 / c.lift_time_s, 1 if mode == LIFT else -1
        up = 3 * t**2 - 2 * t**3
        share = up if mode == LIFT else 1 - up
        self.clock = min(self.clock + TICK_S, c.lift_time_s)
        way = r - self.rest
        rates = sign * (6 * t - 6 * t**2) * per, sign * (6 - 12 * t) * per**2
        return self.rest + share * way, share * v + rates[0] * way, share * a + rates[1] * way


def landed(c: AmbControl, mode: int, clock: float) -> bool:
    """Whether a landing is over, after which no current is asked for."""
    return mode == LAND and clock >= c.lift_time_s
