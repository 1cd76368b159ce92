"""Settings of the lift by the phase angle."""

from __future__ import annotations

import math

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings, SI."""

    gamma_max_rad: float = Field(math.radians(5.2), gt=0)  # how far the phase angle is turned, each way
    rate_rad_s: float = Field(
        math.radians(0.2), gt=0, le=math.radians(0.3)
    )  # of the ramp; the budget is for no faster one
    back_rad_s: float = Field(math.radians(5.0), gt=0)  # back to zero, with the end up
    repeats: int = Field(5, ge=2)  # with each sign of the phase angle
    rest_s: float = Field(0.5, ge=0.1)  # on both rings, before the first lift
    raise_s: float = Field(0.5, gt=0)  # over which the motor's limit grows
    settle_s: float = Field(0.5, gt=0)  # after that, and with the end up
    dwell_s: float = Field(1.0, ge=0.2)  # at gamma 0, on the ring
    confirm_s: float = Field(0.3, ge=0.1)  # without contact, until it is a lift
    average_s: float = Field(0.5, ge=0.1)  # with the end up, at gamma 0
    max_depth_m: float = Field(5e-6, gt=0)  # by which the end may move on its ring
    limit_share: float = Field(
        0.999, gt=0, lt=1
    )  # of its limit that i_y takes at least on the ring, and as much above at most
    max_angle_rad: float = Field(6e-3, gt=0)  # by which the rotor may be off its home angle; four counts at least
    encoder_counts: int = Field(4096, gt=0)  # per turn
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
