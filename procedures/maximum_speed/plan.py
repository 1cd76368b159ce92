"""Settings of the run to the maximum speed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan

HALF, OP = "half", "priority"
SHARINGS = (HALF, OP)
"""How the segments share force and torque, by the settings of the controller: lambda a half, and by T (6.24)."""
WORDS: Mapping[str, str] = {HALF: "λ = 1/2", OP: "λ by (6.24)"}
NAMES: Mapping[str, str] = {HALF: "half", OP: "op"}
"""What they are called to the reader, and in the names of the quantities."""


class Plan(BenchPlan):
    """Settings, SI."""

    limit_A: float = Field(0.0, ge=0)  # of each segment, once the motor carries; 0: the rig file's default
    set_point_m: float = 0.0  # of the motor's end, upwards
    carried_A: float = Field(0.0, ge=0)  # i_y that the set point is moved for; 0: it stays
    commutation: Literal["ahead", "late"] = "ahead"
    bias_A: float = Field(3.0, gt=0)  # of the inboard AMB
    guard_rad_s: float = Field(0.0, ge=0)  # speed reference that ends the run; 0: as high as the controller takes it
    repeats: int = Field(5, ge=3)  # of each sharing, in each direction
    settle_s: float = Field(1.0, gt=0)  # after the motor has taken its end, or moved it
    dwell_s: float = Field(5.0, gt=0)  # after each change of the sharing, before the speed is looked at
    average_s: float = Field(2.0, ge=0.5)
    capture_s: float = Field(1.0, ge=0.2)  # of that, at the controller's full rate
    max_change: float = Field(2e-3, gt=0)  # steady: share by which means over a second differ, twice
    encoder_counts: int = Field(4096, gt=0)  # per turn
    max_lost: float = Field(1e-3, ge=0)  # share of a window's samples
