"""Settings of the torque calibration."""

from __future__ import annotations

import math

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the calibration, SI."""

    masses: tuple[str, ...] = Field(("M1", "M2", "M3"), min_length=2)  # labels of the rig's masses, ascending
    gamma_max_rad: float = Field(0.0873, gt=0.01)  # phase angles from minus to plus this
    gammas: int = Field(5, ge=5)  # equally spaced
    bias_A: float = Field(3.0, gt=0)
    settle_s: float = Field(2.0, gt=0)
    average_s: float = Field(1.0, ge=0.1)
    ki_theta: float = Field(300.0, gt=0)  # A/(rad s) of the angle's integrator while loads hang
    detent_angles: int = Field(4, ge=4)  # over one period of the detent, without load
    wiring_A: float = Field(1.5, gt=0)  # of i_x and i_y, to see which segment is which
    max_angle_rad: float = Field(1e-2, gt=0)  # held: mean angle off home (beyond 2 A the integrator ends, kp holds)
    max_drift_A: float = Field(0.03, gt=0)  # settled: drift of the torque current within a step
    max_baseline_drift_A_s: float = Field(5e-5, gt=0)  # of the current without load, over the run
    max_scale_drift: float = Field(7e-4, gt=0)  # relative, of the torque per current, from the first load to the last
    count_rad: float = Field(2 * math.pi / 4096, gt=0)  # of the rotor's encoder
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
