"""When an end leaves its ring, and from which phase angle on it should: arrays and numbers in and out.

Statics about the plane of the inboard AMB, so that its force drops out. The motor's force on the shaft, T (6.5) with
turn = M (gamma - gamma_0), D and C the direct and the coupled constant of the y winding, a the x winding's over it:

    F_x = a D cos(turn) i_x - C sin(turn) i_y        F_y = D cos(turn) i_y + a C sin(turn) i_x                       (1)

It carries the weight's share and what the stator pulls, alpha_x per metre in the motor's plane. Both together are known where
the motor holds the shaft at the probes' zero at gamma = 0: L = F(i_x0, i_y0). On its ring the end is lower, and the stator
pulls by alpha_x (y_held - y_rest) more. With i_y = I at its limit and i_x such that nothing is left sideways, the ring has no
load at

    D I c + (C s)(L_x + C I s)/(D c) = L_y,    c = cos(turn), s = sin(turn)                                         (2)

a drops out. Times D / c, with T = tan(turn), that is

    f(T) = D^2 I + C^2 I T^2 + (C L_x T - D L_y) sqrt(1 + T^2) = 0                                                  (3)

which is convex about its least value while 2 C^2 I > D L_y: it has two roots, one for each sign of gamma, or none where the
motor lifts at once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from procedures.servomotor.conventions import sensor_share

Array = npt.NDArray[np.float64]
Numbers = Mapping[str, float]
NEWTON = 8
STEP_RAD = 1e-4  # of the differences by which the surplus is told to bend
EARLY, EARLY_S, BESIDE = 0.12, 0.0173, 0.29
"""Of how early an end goes (`early`), by 64 conditions of 4 to 16 lifts of the nominal machine, within 15 mN (rms): noise of
the probes from 0 to 0.5 um, ramps from 0.05 to 0.3 deg/s, angles from 1.3 to 3.4 deg, kd_m from 220 to 450 A s/m. BESIDE, as a
sine, is what pushes along y where gamma turns nothing of i_x there: the inboard loop answers the noise of its probes, too."""
NEAR_N = 0.05  # about the force within which an end goes: there a ramp's rate is taken, for at the flat place it would be none


def leaves(t: Array, y: Array, touches: npt.NDArray[np.bool_], rest_m: float, confirm_s: float) -> int | None:
    """Index of the first sample above half of the rest depth from which on there is none below it and no contact, for
    `confirm_s`; None where there is no such sample."""
    down = (y < rest_m / 2) | touches
    first = int(np.flatnonzero(down)[-1]) + 1 if down.any() else 0
    return first if first < len(t) and t[-1] - t[first] >= 0.9 * confirm_s else None


def planes(p: Numbers) -> tuple[float, float]:
    """Where the motor is, m from the centre of mass, and the outboard sensor's share of a displacement there."""
    z = p["z_oa"] + p["motor_to_outboard"]
    return z, sensor_share(z, p["l_is"], p["l_os"])


def at_motor(p: Numbers, axis: str, inboard: float, outboard: float) -> float:
    """Displacement in m of the motor's plane along "x" or "y" from both readings."""
    share = planes(p)[1]
    return (1 - share) * inboard / p[f"gain_{axis}i"] + share * outboard / p[f"gain_{axis}o"]


def currents(p: Numbers, segments: Array) -> tuple[float, float]:
    """True i_x, i_y in A of four readings."""
    one, two, three, four = ((segments[k] - p[f"offset_m{k + 1}"]) / p[f"gain_m{k + 1}"] for k in range(4))
    return float((four - two) / 2), float((one - three) / 2)


def constants(p: Numbers) -> tuple[float, float, float]:
    """D, C in N/A, and M gamma_0 in rad: alpha_d at home is D cos(M gamma_0)."""
    turn = p["pole_pairs"] * p["gamma_0"]
    return p["alpha_d"] / math.cos(turn), p["alpha_c"], turn


def load(p: Numbers, held: Array, y_m: float, x_m: float) -> tuple[float, float]:
    """(L_x, L_y) N that the motor has to give for the end to lift: by the segments' readings `held` (4,) A with the shaft at
    zero and gamma = 0, and by how much further right and up the motor's plane was then than on the ring, m."""
    d, c, zero = constants(p)
    i_x, i_y = currents(p, held)
    alpha_x = p["alpha_x_prime"] * (p["l_is"] + p["l_os"]) / (planes(p)[0] + p["l_is"])
    across = p["chi"] * i_x
    f_x = d * math.cos(zero) * across + c * math.sin(zero) * i_y
    f_y = d * math.cos(zero) * i_y - c * math.sin(zero) * across
    return f_x + alpha_x * x_m, f_y + alpha_x * y_m


def surplus(p: Numbers, l_x: float, l_y: float, limit_A: float, gamma: float) -> float:
    """By how much the motor's force exceeds what lifts the end, N, at a phase angle: both sides of (2)."""
    d, c, zero = constants(p)
    turn = p["pole_pairs"] * gamma - zero
    across = (l_x + c * limit_A * math.sin(turn)) / (d * math.cos(turn))
    return d * limit_A * math.cos(turn) + c * math.sin(turn) * across - l_y


def ripple(p: Numbers, limit_A: float, gamma: float, theta: float, share: float) -> float:
    """What the ripple of the force may add to the lift, N, if it is `share` of alpha_d and the rotor `theta` rad off home.

    T (5.25): with P = 2 M it turns the forces by alpha_3 P theta. Sideways alpha_3 P theta i_y has i_x answer, which lifts by
    C sin(turn)/(D cos(turn)) of it, and i_x itself lifts by alpha_3 P theta i_x more: to first order twice the former.
    """
    d, c, zero = constants(p)
    turn = p["pole_pairs"] * gamma - zero
    return abs(2 * share * d * 2 * p["pole_pairs"] * theta * limit_A * c / d * math.sin(turn))


def early(p: Numbers, spread_A: float, gamma: float, rate_N_s: float) -> float:
    """By how much force the end goes before the statics let it, N, if the loop that holds x shakes i_x by `spread_A`.

    i_y is at its limit and does not shake, i_x does, and C sin(turn) of it lifts. The end goes when a push carries it so high
    that the stator draws it down by less than the force lacks: the first passage of a noise of F newtons through a bound that
    comes nearer by `rate_N_s`. The slower it comes and the more F is, the more pushes try, which is the logarithm.
    """
    _, c, zero = constants(p)
    force = c * spread_A * math.hypot(math.sin(p["pole_pairs"] * gamma - zero), BESIDE)
    return EARLY * force * math.log1p(force / (EARLY_S * rate_N_s)) if force > 0 else 0.0


def growth(p: Numbers, l_x: float, l_y: float, limit_A: float, gamma: float, way: int) -> tuple[float, float]:
    """How fast the surplus grows with gamma turned further `way`, N/rad, and how that does, N/rad^2."""
    at = [surplus(p, l_x, l_y, limit_A, gamma + k * way * STEP_RAD) for k in (-1, 0, 1)]
    return (at[2] - at[0]) / (2 * STEP_RAD), (at[2] - 2 * at[1] + at[0]) / STEP_RAD**2


def further(first: float, second: float, force: float) -> tuple[float, float]:
    """How much further gamma has to be turned until the surplus has grown by `force` N, rad, and how fast it grows there,
    N/rad; from `growth`. Near the place where the force is least it bends more than it grows."""
    slope = math.sqrt(max(first**2 + 2 * second * force, 0.0))
    return (2 * force / (first + slope) if first + slope > 0 else 0.0), slope


def thresholds(p: Numbers, l_x: float, l_y: float, limit_A: float) -> tuple[float, float, float]:
    """Phase angles below and above from which on the motor lifts, rad, by (3), and how fast the force grows there, N/rad, the
    mean of both. Where there is no root both are where the force is least: it lifts at once."""
    d, c, zero = constants(p)
    square, linear, flat, pull, poles = c**2 * limit_A, c * l_x, d**2 * limit_A, d * l_y, p["pole_pairs"]
    bend = square - pull / 2
    if bend <= 0:
        return math.nan, math.nan, math.nan

    def f(t: float) -> tuple[float, float, float]:
        root = math.sqrt(1 + t**2)
        slope = 2 * square * t + linear * (root + t**2 / root) - pull * t / root
        return (
            flat + square * t**2 + (linear * t - pull) * root,
            slope,
            2 * square + (linear * t * (3 + 2 * t**2) - pull) / root**3,
        )

    least = -linear / (2 * bend)
    for _ in range(NEWTON):
        _, slope, second = f(least)
        least -= slope / second
    low, _, second = f(least)
    if low >= 0:
        middle = (zero + math.atan(least)) / poles
        return middle, middle, 0.0
    ends, slopes = [], []
    for way in (-1, 1):
        t = least + way * math.sqrt(-2 * low / second) * 1.1
        for _ in range(NEWTON):
            value, slope, _ = f(t)
            t -= value / slope
        slopes.append(abs(f(t)[1]) * poles * math.sqrt(1 + t**2) / d)
        ends.append((zero + math.atan(t)) / poles)
    return ends[0], ends[1], (slopes[0] + slopes[1]) / 2
