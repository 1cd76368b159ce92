"""Settings of the force map."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the map, SI."""

    current_A: float = Field(2.0, gt=0)  # of i_x and i_y, each way
    loaded_current_A: float = Field(1.5, gt=0)  # while the lever is loaded
    offset_m: float = Field(40e-6, gt=0, le=80e-6)  # of the outboard AMB's reference, each way
    loaded_offset_m: float = Field(30e-6, gt=0, le=80e-6)
    mass: str = "M3"  # on the lever
    angles: int = Field(9, ge=3)  # equally spaced over a turn; those of the calibration
    bias_A: float = Field(3.0, gt=0)  # that of the calibration
    ramp_A_s: float = Field(2.0, gt=0)
    settle_s: float = Field(1.0, gt=0)
    average_s: float = Field(0.5, ge=0.1)
    max_drift_A: float = Field(5e-3, gt=0)  # of the inboard control current within a point
    max_residual_N: float = Field(0.5, gt=0)  # of the fit, root mean square
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
