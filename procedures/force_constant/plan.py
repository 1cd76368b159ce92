"""Settings of the force-constant run."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the measurement, SI."""

    levels_A: tuple[float, ...] = (-3.0, -1.5, 0.0, 1.5, 3.0)  # of i_y and i_x, ascending, of both signs
    angles: int = Field(9, ge=3)  # equally spaced over a turn; those of the calibration
    bias_A: float = Field(3.0, gt=0)  # that of the calibration
    ramp_A_s: float = Field(2.0, gt=0)
    settle_s: float = Field(2.0, gt=0)  # after each ramp
    average_s: float = Field(1.0, ge=0.1)
    max_position_m: float = Field(5e-8, gt=0)  # settled: |mean position| and its drift within a step
    max_drift_A: float = Field(5e-3, gt=0)  # settled: drift of a control current within a step
    max_wander_N: float = Field(0.3, gt=0)  # drift of the force at constant current over the whole run
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
