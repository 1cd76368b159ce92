"""Settings of the sweep of the phase angle."""

from __future__ import annotations

import math

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings, SI."""

    gamma_rad: tuple[float, ...] = Field(tuple(round(math.radians(d / 2), 9) for d in range(-5, 8)), min_length=5)
    count_rad: float = Field(2 * math.pi / 4096, gt=0)  # one count of the rotor's encoder
    settle_s: float = Field(2.0, gt=0)
    average_s: float = Field(1.0, ge=0.1)
    max_position_m: float = Field(5e-8, gt=0)  # settled: |mean position|; its drift may be twice that
    max_drift_A: float = Field(5e-3, gt=0)  # settled: drift of a current within a step
    max_creep_A: float = Field(2e-3, gt=0)  # drift of i_x, i_y over the sequence
    max_misfit: float = Field(5e-3, gt=0)  # residual over range
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
