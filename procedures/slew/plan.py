"""Settings of the slewing test."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the slewing test, SI."""

    frequencies_hz: tuple[float, ...] = Field((0.1, 0.2, 0.5, 1.0, 2.0), min_length=1)
    amplitude_rad: float = Field(0.4, gt=0, le=0.5)
    periods: int = Field(6, ge=3)  # at each frequency, after a first one that settles
    kp_theta: float = Field(50.0, gt=0)  # A/rad
    kd_theta: float = Field(0.5, gt=0)  # A s/rad, on the error
    ki_theta: float = Field(50.0, ge=0)  # A/(rad s)
    angle_hz: float = Field(60.0, gt=0)  # filter of the derivative
    motor_carries: bool = False  # the shaft too, in place of the outboard AMB
    torque_constant: Literal["design", "calibration"] = "design"  # calibration: of `torque-constant`
    detent_order: int = Field(16, gt=0)  # per turn
    settle_s: float = Field(1.0, gt=0)  # before each swing
    encoder_counts: int = Field(4096, gt=0)  # per turn
    max_detent_N_m: float = Field(0.05, gt=0)  # beyond, it is named
    max_friction_N_m: float = Field(0.2, gt=0)  # a levitated rotor has no more
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
