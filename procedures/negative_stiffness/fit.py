"""Negative stiffness of the motor from eccentric positioning (thesis end of 6.6.2, and 6.8).

Everything is statics about the plane of the inboard AMB, so that its force, and with it its stiffness, drops out.

By the motor (outboard AMB off). Gravity's moment is constant, so the motor's force is. With i_x, i_y freed of the sensors'
gains and offsets, alpha_dx = chi alpha_d, s the coupling of the encoder's zero (alpha_c sin M gamma_0, home angle):

    alpha_d i_y + s chi i_x + alpha_x y_m = const          alpha_d chi i_x - s i_y + alpha_x x_m = const

By the AMBs (motor without current). With ratio = (s + e)/s, s from AMB to AMB and e from outboard AMB to motor,

    F_o + ratio alpha_x y_m = const,      F_o = A ip^2 / (1 - y/g_p)^2 - B in^2 / (1 + y/g_n)^2

where A, B come from the calibration (K = 2 b (A + B), K2 = A - B), y is the journal's displacement at the outboard AMB,
g_p = g (1 - e_0), g_n = g (1 + e_0), and A/B = ((1 + e_0)/(1 - e_0))^2. The gap g and alpha_x are both unknown. What
belongs to the AMB scales with the square of the bias, what belongs to the motor does not: two biases tell them apart.

alpha_x' = alpha_x (z_m - z_is)/(z_os - z_is) refers to the outboard sensor's plane with the inboard one held.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.servomotor.conventions import displacement, sensor_share
from procedures.servomotor.segments import radial_currents
from procedures.shared import leastsquares
from procedures.shared.leastsquares import Fit

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ByMotor:
    """Step means (N,) while the motor carries the outboard end. `segments` (4, N) A and `y`, `x` (2, N) m [inboard,
    outboard sensor], all as the sensors read; `time_s` (N,)."""

    segments: Array
    y: Array
    x: Array
    time_s: Array


@dataclass(frozen=True)
class ByAmbs:
    """Step means (N,) while both AMBs carry. `coils` (2, N) A, outboard vertical coils p and n; `y` (2, N) m [inboard,
    outboard sensor]; `which` (N,) index into `bias_A` (2,); `branch` (N,) +1 reached from below, -1 from above; `time_s`
    (N,)."""

    coils: Array
    y: Array
    which: npt.NDArray[np.int64]
    branch: Array
    time_s: Array
    bias_A: tuple[float, float]


@dataclass(frozen=True)
class MotorFit:
    """`fit` of the two force equations, terms [alpha_x, F_y, D_y, s, F_x, D_x] in N/m, N, N (over the sequence), N/A, N, N;
    `i_y` (N,) A and the `force` (N,) N it gives, `y_m` (N,) m; `stiffness` alpha_x' N/m."""

    fit: Fit
    i_y: Array
    force: Array
    y_m: Array
    stiffness: float


@dataclass(frozen=True)
class AmbFit:
    """`fit` of the moment equation, terms [alpha_x, 1/g, then F, H, D (branch, drift over the series) N at each bias];
    `force` (N,) N of the outboard AMB less what displacement adds at constant current, `total` (N,) N with it, `y_o` and
    `y_m` (N,) m; `stiffness` alpha_x' N/m, `gap_m`."""

    fit: Fit
    force: Array
    total: Array
    y_o: Array
    y_m: Array
    stiffness: float
    gap_m: float


def motor_plane(p: Mapping[str, float]) -> float:
    """The motor's plane, m from the centre of mass."""
    return p["z_oa"] + p["motor_to_outboard"]


def _at(z: float, inboard: Array, outboard: Array, p: Mapping[str, float]) -> Array:
    return displacement(inboard, outboard, sensor_share(z, p["l_is"], p["l_os"]))


def by_motor(d: ByMotor, p: Mapping[str, float]) -> MotorFit:
    """alpha_x' from the motor's own current.

    `p` holds alpha_d, chi, gain_m1 .. offset_m4, gain_yi, gain_yo, gain_xi, gain_xo, l_is, l_os, z_oa, motor_to_outboard.
    Each equation has a term linear in time: the sequence is mirrored, so that drift shows and does not matter.
    """
    i_x, i_y = radial_currents(d.segments, p)
    zm = motor_plane(p)
    y_m = _at(zm, d.y[0] / p["gain_yi"], d.y[1] / p["gain_yo"], p)
    x_m = _at(zm, d.x[0] / p["gain_xi"], d.x[1] / p["gain_xo"], p)
    one, none = np.ones_like(i_y), np.zeros_like(i_y)
    t = d.time_s / max(float(np.ptp(d.time_s)), 1e-9) - 0.5
    vertical = [-y_m, one, t, -p["chi"] * i_x, none, none]
    horizontal = [-x_m, none, none, i_y, one, t]
    design = np.concatenate([np.stack(vertical, axis=1), np.stack(horizontal, axis=1)])
    force = p["alpha_d"] * i_y
    fit = leastsquares.linear(design, np.concatenate([force, p["alpha_d"] * p["chi"] * i_x]))
    share = sensor_share(zm, p["l_is"], p["l_os"])
    return MotorFit(fit, i_y, force, y_m, float(fit.terms[0]) * share)


def ring(k: float, k2: float, bias_A: float) -> tuple[float, float, float]:
    """A, B (N/A^2) of F = A ip^2 - B in^2 at the sensors' zero, and e_0 = offset/gap, from K (N/A) and K2 (N/A^2)."""
    total = k / (2 * bias_A)
    a, b = (total + k2) / 2, (total - k2) / 2
    root = np.sqrt(a / b)
    return a, b, float((root - 1) / (root + 1))


def by_ambs(d: ByAmbs, p: Mapping[str, float]) -> AmbFit:
    """alpha_x' and the gap from the outboard AMB's currents at two biases.

    `p` holds K_o, K2_o (home angle, at bias_K), bias_K, gain_op, gain_on, offset_op, offset_on, gain_yi, gain_yo, l_is,
    l_os, z_oa, amb_span, motor_to_outboard and amb_gap (a start value only).
    """
    a, b, offset = ring(p["K_o"], p["K2_o"], p["bias_K"])
    ip, i_n = ((d.coils[k] - p[f"offset_o{c}"]) / p[f"gain_o{c}"] for k, c in enumerate("pn"))
    inboard, outboard = d.y[0] / p["gain_yi"], d.y[1] / p["gain_yo"]
    y_o, y_m = _at(p["z_oa"], inboard, outboard, p), _at(motor_plane(p), inboard, outboard, p)
    lever = (p["amb_span"] + p["motor_to_outboard"]) / p["amb_span"]
    rest = np.column_stack([lever * y_m, *(_series(d, which) for which in (0, 1))])
    pull, push = a * ip**2, b * i_n**2
    up, down = y_o / (1 - offset), y_o / (1 + offset)

    def force(inverse_gap: float) -> Array:
        out: Array = pull / (1 - inverse_gap * up) ** 2 - push / (1 + inverse_gap * down) ** 2
        return out

    def model(terms: Array) -> Array:
        out: Array = force(terms[1]) + rest @ np.delete(terms, 1)
        return out

    def jacobian(terms: Array) -> Array:
        slope = 2 * (pull * up / (1 - terms[1] * up) ** 3 + push * down / (1 + terms[1] * down) ** 3)
        return np.column_stack([rest[:, 0], slope, rest[:, 1:]])

    # At the gap of the drawing everything else is linear: a start from which the iteration needs a few steps.
    around = leastsquares.linear(rest, -force(1 / p["amb_gap"])).terms
    fit = leastsquares.nonlinear(model, np.zeros_like(ip), np.insert(around, 1, 1 / p["amb_gap"]), jacobian=jacobian)
    share = sensor_share(motor_plane(p), p["l_is"], p["l_os"])
    return AmbFit(fit, pull - push, force(fit.terms[1]), y_o, y_m, float(fit.terms[0]) * share, 1 / float(fit.terms[1]))


def _series(d: ByAmbs, which: int) -> Array:
    """Columns (N, 3) of one bias: constant, branch, time from -1/2 to 1/2; zero at the other."""
    use = d.which == which
    t = d.time_s - d.time_s[use].min()
    t = t / max(float(np.ptp(t[use])), 1e-9) - 0.5
    out: Array = np.stack([np.ones_like(t), d.branch, t], axis=1) * use[:, None]
    return out


def at_one_bias(d: ByAmbs, p: Mapping[str, float]) -> float:
    """The erratum: "analogous to that just described" (T 6.6.2), AMB currents times the calibrated constants at one bias, as
    if the AMBs had no position stiffness. N/m, far too large; kept to show by how much."""
    use = d.which == 0
    y_m = _at(motor_plane(p), d.y[0, use] / p["gain_yi"], d.y[1, use] / p["gain_yo"], p)
    current = (d.coils[0, use] - d.coils[1, use]) / 2
    lever = (p["amb_span"] + p["motor_to_outboard"]) / p["amb_span"]
    slope = float(np.polyfit(y_m, p["K_o"] * current, 1)[0])
    return -slope / lever * sensor_share(motor_plane(p), p["l_is"], p["l_os"])


def scaled(fit: Fit) -> float:
    """Standard deviation of a residual, in the unit of the observations."""
    return float(np.sqrt(fit.chi2 / max(fit.dof, 1)))
