"""From which phase angle on the motor truly lifts its end: statics of the machine's own constants, with no motion in it.

The inboard AMB holds its plane where the probes make it zero, the outboard AMB has no current and so no force, the outboard end
lies on its ring. The motor's law holds x at the outboard probe's zero, and i_y is at its limit. The end leaves its ring where
the ring need not carry it any more: it is drawn to the stator the more the lower it is, so that nothing stops it from there on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim_backend.machines.tsbs.params import ControlParams, PlantParams

FURTHEST_RAD = math.radians(8)  # where the search ends: there the force has turned by 64 degrees
STEPS, HALVINGS = 128, 40


@dataclass(frozen=True)
class Resting:
    """How the shaft lies while the inboard end is held: `x`, `y` m of the motor's plane, and `depth` m of the outboard end
    under the place where its vertical probe reads zero."""

    x: float
    y: float
    depth: float


def blind(p: PlantParams, sensor: int) -> float:
    """What a probe (0 to 3: xi, yi, xo, yo) adds at the home angle to a displacement in m, referred to true metres."""
    b, upright = divmod(sensor, 2)
    part = math.sin if upright else math.cos
    runout = sum(
        a * part(q) for a, q in zip(p.target[4 * b : 4 * b + 4], p.target_phase[4 * b : 4 * b + 4], strict=True)
    )
    return runout + p.position_offset[sensor] / p.position_gain[sensor]


def resting(p: PlantParams) -> Resting:
    """Where it lies at the home angle."""
    x_o = -blind(p, 2) - p.ring_x[1]
    y_o = p.ring_y[1] - math.sqrt(p.clearance**2 - x_o**2)
    share, z_i, z_o = ControlParams().share_i, *p.z_sensor
    seen = p.position_gain[3] * (y_o + blind(p, 3))
    inboard = (-blind(p, 0), -share / (1 - share) * seen / p.position_gain[1] - blind(p, 1))
    part = (p.z_motor - z_i) / (z_o - z_i)
    x, y = (i + part * (o - i) for i, o in zip(inboard, (x_o + p.ring_x[1], y_o), strict=True))
    return Resting(x, y, -(y_o + blind(p, 3)))


def surplus(p: PlantParams, at: Resting, gamma: float, limit_A: float) -> float:
    """By how much the motor's force and the stator's pull exceed what lifts the end from its ring, N, at a phase angle."""
    turn = p.pole_pairs * (gamma - p.gamma_zero)
    c, q = math.cos(turn), math.sin(turn)
    # the amplifiers hold their own sensors at the limit
    up = p.segment_gain[0] * (limit_A - p.segment_offset[0]) / p.segment_sense[0]
    down = p.segment_gain[2] * (-limit_A - p.segment_offset[2]) / p.segment_sense[2]
    i_y, shared = (up - down) / 2, (up + down) / 2
    direct, cross = p.alpha_d - p.alpha_2, p.alpha_c + p.alpha_3
    arm = -p.z_amb[0] / (p.z_motor - p.z_amb[0])
    need_x, need_y = (p.mass * p.gravity * part * arm for part in (-math.sin(p.tilt), math.cos(p.tilt)))
    x, y = at.x + p.motor_x, at.y + p.motor_y
    mean = p.detent * math.sin(p.detent_phase) / p.alpha_tau - p.beta_2 * x * i_y * c / p.alpha_tau
    i_x = 0.0
    for _ in range(3):  # torque, pull and force act on each other a little
        torque = mean + p.beta_2 * y * i_x * c / p.alpha_tau
        pull_x = p.alpha_6 * i_y * shared
        i_x = (need_x + cross * i_y * q + p.alpha_4 * torque * y - p.alpha_x * x - pull_x) / (direct * c)
    pull_y = p.alpha_6 * i_x * (2 * torque - shared)
    return direct * i_y * c + cross * i_x * q + p.alpha_4 * torque * x + p.alpha_x * y - pull_y - need_y


def thresholds(p: PlantParams, limit_A: float) -> tuple[float, float] | None:
    """The angles, below and above, from which on the motor lifts as gamma is turned away from zero, rad; None where it lifts at
    zero, or never. Whether an end that presses lightly is taken up by the start's motion is no matter of statics."""
    at = resting(p)

    def left(gamma: float) -> float:
        return surplus(p, at, gamma, limit_A)

    if left(0.0) >= 0:
        return None
    out = []
    for way in (-1, 1):
        furthest = abs(p.gamma_zero + way * FURTHEST_RAD)
        steps = [way * furthest * k / STEPS for k in range(STEPS + 1)]
        beyond = next((k for k, gamma in enumerate(steps) if left(gamma) >= 0), None)
        if beyond is None:
            return None
        low, high = steps[beyond - 1], steps[beyond]
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if left(middle) >= 0 else (middle, high)
        out.append(high)
    return out[0], out[1]


def quantities(p: PlantParams, limit_A: float) -> dict[str, float]:
    """Of the procedure `lift-off`: mean and half difference of both angles, rad, and how deep the end lies, m."""
    out = {"rest_depth": resting(p).depth}
    if (found := thresholds(p, limit_A)) is not None:
        half, mean = (found[1] - found[0]) / 2, (found[1] + found[0]) / 2
        out |= {"gamma_lift": half, "gamma_predicted": half, "gamma_zero": mean}
    return out
