"""Settings of the angle step."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan

Allocation = Literal["static", "priority"]


class Plan(BenchPlan):
    """Settings of the angle step, SI."""

    steps_rad: tuple[float, ...] = Field((math.radians(2), math.radians(12)), min_length=1)
    steps_static_rad: tuple[float, ...] = ()  # those with the static one, if others
    allocations: tuple[Allocation, ...] = Field(("static", "priority"), min_length=1)
    filters_hz: tuple[float, ...] = Field((200.0,), min_length=1)  # of the angle's derivative
    repeats: int = Field(3, ge=2)  # each way
    kp_theta: float = Field(50.0, gt=0)  # A/rad
    kd_theta: float = Field(0.5, gt=0)  # A s/rad, on the error
    ki_theta: float = Field(50.0, ge=0)  # A/(rad s)
    settle_s: float = Field(2.0, gt=0)  # after the motor has taken the shaft
    standstill_s: float = Field(0.5, ge=0.1)  # before each step
    record_s: float = Field(1.5, ge=0.6)  # after it
    band: float = Field(0.02, gt=0)  # of settling, as a share of the step; at least two encoder counts
    encoder_counts: int = Field(4096, gt=0)  # per turn
    max_hold_A: float = Field(0.06, gt=0)  # torque current at rest: drag of a levitated rotor needs half of it
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
