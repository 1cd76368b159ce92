"""Statics of the shaft for tests of estimators: forces of one plane of motion solved by root finding, from the equations of
the thesis (6.5, 6.6, 2.4) and not from the estimators' own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import optimize

from procedures.force_coupling.fit import Sweep
from procedures.negative_stiffness.fit import ByAmbs, ByMotor

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Shaft:
    """T Tables 6.1 and 6.2, with what is not printed there."""

    weight: float = 10.2 * 9.81
    z_is: float = -0.161
    z_ia: float = -0.115
    z_oa: float = 0.010
    z_os: float = 0.052
    z_m: float = 0.122
    alpha_d: float = 12.1
    alpha_c: float = 14.3
    alpha_x: float = 242.6e3
    gamma_0: float = 0.0
    winding: float = 1.0  # x over y
    motor_y: float = 12e-6
    gap: float = 0.5e-3
    beta_i: float = 73.2 * 0.25e-6 / 12
    beta_o: float = 74.4 * 0.25e-6 / 12
    offset_i: float = 10e-6
    offset_o: float = -15e-6
    pole_pairs: float = 8.0

    @property
    def stiffness(self) -> float:
        """alpha_x', N/m."""
        return self.alpha_x * (self.z_m - self.z_is) / (self.z_os - self.z_is)

    def amb(self, bearing: str, y: float, bias: float, i: float) -> float:
        """Force of one AMB in N (T 2.4)."""
        beta, offset = (self.beta_i, self.offset_i) if bearing == "i" else (self.beta_o, self.offset_o)
        xi = y + offset
        return beta * ((bias + i) ** 2 / (self.gap - xi) ** 2 - (bias - i) ** 2 / (self.gap + xi) ** 2)

    def constants(self, bias: float = 3.0) -> tuple[float, float]:
        """K_o, K2_o at the sensors' zero."""
        near, far = self.beta_o / (self.gap - self.offset_o) ** 2, self.beta_o / (self.gap + self.offset_o) ** 2
        return 2 * bias * (near + far), near - far

    def plane(self, y_is: float, y_os: float, z: float) -> float:
        """Displacement at plane z."""
        return y_is + (y_os - y_is) * (z - self.z_is) / (self.z_os - self.z_is)

    def by_ambs(self, y_is: float, y_os: float, bias: float) -> tuple[float, float]:
        """Control currents i_i, i_o with which the AMBs hold the shaft displaced, the motor without current."""
        pull = self.alpha_x * (self.plane(y_is, y_os, self.z_m) + self.motor_y)
        span = self.z_oa - self.z_ia
        f_o = (self.weight * -self.z_ia - pull * (self.z_m - self.z_ia)) / span
        f_i = self.weight - pull - f_o
        planes = {"i": self.plane(y_is, y_os, self.z_ia), "o": self.plane(y_is, y_os, self.z_oa)}
        currents = [
            optimize.brentq(lambda i, b=b, f=f: self.amb(b, planes[b], bias, i) - f, -2 * bias, 2 * bias)
            for b, f in (("i", f_i), ("o", f_o))
        ]
        return currents[0], currents[1]

    def by_motor(
        self,
        y_is: float,
        y_os: float,
        gamma: float = 0.0,
        side: float = 3.0,
        *,
        ripple: tuple[float, float] = (0.0, 0.0),
        theta: float = 0.0,
    ) -> tuple[float, float]:
        """i_x, i_y with which the motor holds the outboard end; `side` N pulls the motor's plane horizontally."""
        up = self.weight * -self.z_ia / (self.z_m - self.z_ia)
        up -= self.alpha_x * (self.plane(y_is, y_os, self.z_m) + self.motor_y)
        turn = self.pole_pairs * (gamma - self.gamma_0)
        beta = 2 * self.pole_pairs * theta + turn
        direct = self.alpha_d * np.cos(turn) - ripple[0] * np.cos(beta)
        cross = self.alpha_c * np.sin(turn) + ripple[1] * np.sin(beta)
        i_x, i_y = np.linalg.solve([[direct * self.winding, -cross], [cross * self.winding, direct]], [-side, up])
        return float(i_x), float(i_y)


def levels_there_and_back(levels: tuple[float, ...]) -> tuple[Array, Array]:
    """Levels up and down, and the branch of each."""
    up, down = list(levels), list(levels[-2::-1])
    return np.array(up + down), np.array([-1.0] + [1.0] * (len(up) - 1) + [-1.0] * len(down))


def segments(i_x: Array, i_y: Array, torque: float = 0.0) -> Array:
    """T (6.9)."""
    return np.array([torque + i_y, torque - i_x, torque - i_y, torque + i_x])


def motor_data(s: Shaft, levels: tuple[float, ...], y_is: float = 0.0) -> ByMotor:
    """Step means as ideal sensors read them, the motor carrying."""
    y, _ = levels_there_and_back(levels)
    inboard = np.full_like(y, y_is) * np.sign(y)
    i = np.array([s.by_motor(a, b) for a, b in zip(inboard, y, strict=True)])
    return ByMotor(
        segments(i[:, 0], i[:, 1], 0.01), np.array([inboard, y]), np.zeros((2, len(y))), np.arange(len(y)) * 1.0
    )


def amb_data(s: Shaft, levels: tuple[float, ...], biases: tuple[float, float], play: float = 0.0) -> ByAmbs:
    """Step means as ideal sensors read them, the AMBs carrying at two biases, the inboard AMB's plane held."""
    y, branch = levels_there_and_back(levels)
    share = (s.z_ia - s.z_is) / (s.z_os - s.z_is)
    inboard = -share / (1 - share) * y
    coils, which = [], []
    for k, bias in enumerate(biases):
        for a, b, side in zip(inboard, y, branch, strict=True):
            i = s.by_ambs(a, b, bias)[1] - side * play
            coils.append((bias + i, bias - i))
            which.append(k)
    both = np.array([np.tile(inboard, 2), np.tile(y, 2)])
    return ByAmbs(np.array(coils).T, both, np.array(which), np.tile(branch, 2), np.arange(len(coils)) * 1.0, biases)


def sweep_data(s: Shaft, degrees: Array, ripple: tuple[float, float] = (0.0, 0.0)) -> Sweep:
    """Step means over gamma there and back, ideal sensors, the rotor at half a count before and behind home. `ripple` is
    alpha_2, alpha_3 in N/A, by T (5.25) with a phase angle."""
    gamma = np.radians(np.concatenate([degrees, degrees[::-1]]))
    theta = np.pi / 4096 * np.where(np.arange(len(gamma)) < len(degrees), 1.0, -1.0)
    i = np.array([s.by_motor(0.0, 0.0, g, ripple=ripple, theta=t) for g, t in zip(gamma, theta, strict=True)])
    zero = np.zeros((2, len(gamma)))
    return Sweep(segments(i[:, 0], i[:, 1], 0.01), zero, zero, gamma, theta, np.arange(len(gamma)) * 1.0)


def parameters(s: Shaft) -> dict[str, float]:
    """What the estimators need besides the data, exact."""
    k, k2 = s.constants()
    alpha_d = s.alpha_d * float(np.cos(s.pole_pairs * s.gamma_0))
    out = {"alpha_d": alpha_d, "chi": s.winding, "K_o": k, "K2_o": k2, "bias_K": 3.0, "pole_pairs": s.pole_pairs}
    out |= {"l_is": -s.z_is, "l_os": s.z_os, "z_oa": s.z_oa, "z_m": s.z_m, "motor_to_outboard": s.z_m - s.z_oa}
    out |= {"amb_span": s.z_oa - s.z_ia, "amb_gap": 0.51e-3, "per_metre": s.alpha_x / s.alpha_d}
    for name in ("yi", "yo", "xi", "xo", "m1", "m2", "m3", "m4", "op", "on"):
        out |= {f"gain_{name}": 1.0, f"offset_{name}": 0.0}
    return out
