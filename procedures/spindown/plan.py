"""Settings of the spindown."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the spindown, SI."""

    speed_rad_s: float = Field(60.0, gt=5)  # where a run-down starts
    end_speed_rad_s: float = Field(3.0, gt=0.5)  # and where its fit ends
    repeats: int = Field(3, ge=2)  # each way, at each bias
    bias_A: float = Field(3.0, gt=0)
    bias_high_A: float = Field(4.0, gt=0)
    added_inertia: bool = False  # mount the ring and take the inertia from it
    motor_carries: bool = False  # the outboard end in place of its AMB, which is idle: there is less of what drags
    settle_s: float = Field(1.0, gt=0)  # after the motor has taken that end
    run_up: Literal["auto", "drive", "motor"] = "auto"  # auto: the drive if the rig has one
    steady_s: float = Field(0.5, ge=0.1)  # at speed before it is let go
    start_delay_s: float = Field(0.1, ge=0)  # for the transient of the speed's filter
    coast_s: float = Field(15.0, gt=0)  # at most
    speed_filter_hz: float = Field(20.0, gt=0)  # of the controller's speed channel
    max_coulomb_N_m: float = Field(0.12, gt=0)  # a levitated rotor has no more
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
