"""Statics of the shaft held by both AMBs against the motor, for tests of the force-constant estimator: currents by root
finding from the equations of the thesis (2.4, 6.5, 6.13), not from the estimator's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import optimize

from procedures.force_constant.fit import Ramps
from procedures.force_constant.plan import Plan
from procedures.force_constant.procedure import sequence

Array = npt.NDArray[np.float64]
BIAS, WEIGHT, L_OA, SPAN, REACH, GAP = 3.0, 10.2 * 9.81, 0.010, 0.125, 0.112, 5e-4


@dataclass(frozen=True)
class Machine:
    """T Tables 6.1 and 6.2. `xi` are the journals' distances from the magnetic centres over the angle, by bearing and
    axis; `asymmetry` of each AMB's x axis; `play` N of the AMBs' hysteresis as a share of slope times A."""

    alpha_d: float = 12.1
    alpha_c: float = 14.3
    alpha_2: float = 0.3
    alpha_3: float = 0.2
    gamma_0: float = 0.004
    slopes: tuple[float, float] = (73.2, 74.4)
    asymmetry: tuple[float, float] = (0.0, 0.0)
    play: float = 0.0
    drift: float = 0.0  # A/s of segment 1
    shift: float = 0.0  # m by which the rotor stands off in y at the AMB planes
    stiffness: float = 242.6e3
    pull_x: float = 2.0  # N on the motor's plane, constant

    def xi(self, axis: str, bearing: int, angle: float) -> float:
        """m; runout of 26 um on an offset."""
        offset = {"y": (20e-6, -25e-6), "x": (-12e-6, 18e-6)}[axis][bearing]
        turn = angle + (0.3, 1.4)[bearing]
        return offset + 26e-6 * (np.sin(turn) if axis == "y" else np.cos(turn))

    def ripple(self, angle: float) -> tuple[float, float]:
        """alpha of the own axis, and dF_y/di_x (= -dF_x/di_y)."""
        turn, b = -8 * self.gamma_0, 16 * angle - 8 * self.gamma_0
        direct = self.alpha_d * np.cos(turn) - self.alpha_2 * np.cos(b)
        return float(direct), float(self.alpha_c * np.sin(turn) + self.alpha_3 * np.sin(b))

    def constants(self, axis: str, bearing: int, angle: float) -> tuple[float, float]:
        """K and K2 at the sensors' zero."""
        beta = self.slopes[bearing] * GAP**2 / (4 * BIAS) * (1 + (axis == "x") * self.asymmetry[bearing])
        xi = self.xi(axis, bearing, angle)
        near, far = beta / (GAP - xi) ** 2, beta / (GAP + xi) ** 2
        return 2 * BIAS * (near + far), near - far

    def coil_currents(
        self, axis: str, bearing: int, angle: float, force: float, off: float, branch: float
    ) -> tuple[float, float]:
        beta = self.slopes[bearing] * GAP**2 / (4 * BIAS) * (1 + (axis == "x") * self.asymmetry[bearing])
        xi = self.xi(axis, bearing, angle) + off

        def unbalanced(i: float) -> float:
            return beta * ((BIAS + i) ** 2 / (GAP - xi) ** 2 - (BIAS - i) ** 2 / (GAP + xi) ** 2) - force

        i = optimize.brentq(unbalanced, -2 * BIAS, 2 * BIAS, xtol=1e-15, rtol=1e-15) + branch * self.play
        return BIAS + i, BIAS - i


def ramps(m: Machine, axis: str = "y", angles: int = 9, plan: Plan | None = None) -> Ramps:
    """Step means as ideal sensors read them."""
    levels = sequence(plan or Plan())
    turns = 2 * np.pi * np.arange(angles) / angles
    i_y, i_x = (np.array([getattr(x, name) for x in levels]) for name in ("i_y", "i_x"))
    own, other = (i_y, i_x) if axis == "y" else (i_x, i_y)
    branch = np.array([getattr(x, f"branch_{axis}") for x in levels], float)
    time = 2.0 * (np.arange(len(levels)) - (len(levels) - 1) / 2)
    coils = np.zeros((2, 2, angles, len(levels)))
    motor_off = m.shift * (axis == "y")
    for a, angle in enumerate(turns):
        direct, cross = m.ripple(angle)
        cross *= 1 if axis == "y" else -1
        for p in range(len(levels)):
            true = own[p] + (m.drift * time[p] / 2 if axis == "y" else 0.0)
            force = direct * true + cross * other[p] + m.stiffness * motor_off + m.pull_x * (axis == "x")
            weight = WEIGHT * (axis == "y")
            inboard = weight * L_OA / SPAN + force * REACH / SPAN
            outboard = weight - force - inboard
            for b, f in enumerate((inboard, outboard)):
                side = branch[p] * (1 if b == 0 else -1)
                coils[b, :, a, p] = m.coil_currents(axis, b, angle, f, motor_off, side)
    segments = np.array([i_y, -i_x, -i_y, i_x])[:, None, :] + 0.01 + np.zeros((4, angles, 1))
    off = np.full((angles, len(levels)), motor_off)
    level = np.broadcast_to(own, off.shape)
    return Ramps(axis, coils, segments, np.stack([off, off]), off, np.broadcast_to(branch, off.shape),
                 np.isin(level, (own.min(), own.max())).astype(float), np.broadcast_to(time, off.shape), turns)  # fmt: skip


def parameters(m: Machine, angles: int = 9) -> dict[str, float]:
    """What the estimator needs besides the data, exact."""
    out = {"amb_span": SPAN, "motor_to_outboard_amb": REACH, "amb_gap": GAP, "motor_stiffness": m.stiffness,
           "asymmetry_i": m.asymmetry[0], "asymmetry_o": m.asymmetry[1]}  # fmt: skip
    for short in [f"{axis}{b}{c}" for axis in "yx" for b in "io" for c in "pn"] + [f"m{k}" for k in range(1, 5)]:
        out |= {f"gain_{short}": 1.0, f"offset_{short}": 0.0}
    return out | facts(m, angles)


def facts(m: Machine, angles: int = 9) -> dict[str, float]:
    """The calibration's constants at each angle, exact."""
    out: dict[str, float] = {}
    for b, name in enumerate("io"):
        for k in range(angles):
            out[f"K_{name}@{k}"], out[f"K2_{name}@{k}"] = m.constants("y", b, 2 * np.pi * k / angles)
    return out


def changed(values: Mapping[str, float], prefix: str, factor: float) -> dict[str, float]:
    """Values with those of one prefix scaled."""
    return {k: v * factor if k.startswith(prefix) else v for k, v in values.items()}
