"""The AMB stand's closed loop, linearised about where it floats, as frequency responses in closed form."""

from __future__ import annotations

import cmath

import numpy as np
import numpy.typing as npt
from amb_plants import AmbPlant

from sim_backend.machines.amb5dof.params import AmbControl
from sim_backend.machines.amb5dof.reference import amb_force
from sim_backend.machines.amb5dof.reference_law import Model

Complex = npt.NDArray[np.complex128]
T = 1e-4


def arms(inboard: float, outboard: float) -> npt.NDArray[np.float64]:
    """Displacements yi zi yo zo of two planes from y z psi theta."""
    return np.array([[1, 0, 0, -inboard], [0, 1, inboard, 0], [1, 0, 0, outboard], [0, 1, -outboard, 0]])


class Linear:
    """Frequency responses of a rigid stand whose controller knows it exactly, at a speed in rad/s."""

    def __init__(self, plant: AmbPlant, control: AmbControl, omega: float) -> None:
        self.p, self.c, self.omega = plant.params, control, omega
        state, p = plant.state(), plant.params
        self.at_amb, self.at_sensor = arms(p.l_ia, p.l_oa), arms(p.l_is, p.l_os)
        xi = self.at_amb @ state["s"][1:5] + p.offset
        currents = state["coil"][:8].reshape(4, 2)

        def force(k: int, dx: float, di: float) -> float:
            ip, i_n = currents[k]
            return amb_force(p.beta[k], p.gap, xi[k] + dx, ip + di, i_n - di)

        self.k_i = np.diag([(force(k, 0, 1e-6) - force(k, 0, -1e-6)) / 2e-6 for k in range(4)])
        self.k_x = np.diag([(force(k, 1e-9, 0) - force(k, -1e-9, 0)) / 2e-9 for k in range(4)])

    def controller(self, w: float) -> Complex:
        """Differential currents of the four axes per sensor displacement, at the samples."""
        c, z = self.c, cmath.exp(1j * w * T)
        keep = 1 / (1 + 2 * np.pi * c.derivative_hz * T)
        rate = (1 - keep) * (1 - 1 / z) / T / (1 - keep / z)
        if c.law == 0:  # the integral is as it was before this sample
            return np.asarray(-(c.kp + c.ki * T / (z - 1) + c.kd * rate) * np.eye(4))
        model = Model(c)
        whole = -(c.k2_ccs * rate + c.k1 + c.k0 * T * z / (z - 1))
        to_q = np.linalg.inv(self.at_sensor)
        zero = np.array(model.flat(np.zeros(5), np.zeros(5), np.zeros(5), self.omega))
        columns = []
        for k in range(4):
            q = np.zeros(5, complex)
            q[k + 1] = 1.0
            columns.append((np.array(model.flat(q, rate * q, whole * q, self.omega)) - zero)[:4])
        inverse = np.linalg.inv(self.k_i)
        return np.asarray(inverse @ (np.array(columns).T - self.k_x @ self.at_amb) @ to_q)

    def actuator(self, w: float) -> complex:
        """One sample of delay, hold, current loop."""
        jw = 1j * w
        return cmath.exp(-jw * T) * (1 - cmath.exp(-jw * T)) / (jw * T) / (1 + jw / self.p.amplifier_rate)

    def dynamics(self, w: float) -> Complex:
        """Forces and moments (y z psi theta) per displacement, without what the control currents do."""
        p, gyro = self.p, self.p.polar_inertia * self.omega
        mass = np.diag([p.mass, p.mass, p.inertia, p.inertia])
        spin = np.zeros((4, 4))
        spin[2, 3], spin[3, 2] = gyro, -gyro
        end = np.array([[1, 0, 0, -p.l_c], [0, 1, p.l_c, 0]])
        springs = p.coupling * end.T @ end - self.at_amb.T @ self.k_x @ self.at_amb
        return np.asarray(-(w**2) * mass + 1j * w * spin + springs)

    def unbalance(self) -> Complex:
        """Displacements in the sensor planes, x = Re(a e^(j phi)), of the plant's own unbalance."""
        p, w = self.p, self.omega
        u = np.array(p.unbalance) * np.exp(1j * np.array(p.unbalance_phase)) * w**2
        planes = np.array([u[0], -1j * u[0], u[1], -1j * u[1]])  # z follows y by 90 deg
        drive = self.at_amb.T @ self.k_i @ self.controller(w) @ self.at_sensor * self.actuator(w)
        return np.asarray(self.at_sensor @ np.linalg.solve(self.dynamics(w) - drive, arms(p.l_iu, p.l_ou).T @ planes))

    def sensitivity(self, w: float, axis: int) -> complex:
        """(reference with the injected current)/(injected current) of one axis, the others closed."""
        plant = self.at_sensor @ np.linalg.solve(self.dynamics(w), self.at_amb.T @ self.k_i) * self.actuator(w)
        return complex(np.linalg.inv(np.eye(4) - self.controller(w) @ plant)[axis, axis])
