"""Settings of load balancing."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan

Way = Literal["forward", "backward"]


class Plan(BenchPlan):
    """Settings of load balancing, SI."""

    radius_m: float = Field(100e-6, gt=0)  # of the circle, at the outboard sensors
    circle_hz: float = Field(0.25, gt=0, le=1)  # turns of it in a second
    ways: tuple[Way, ...] = Field(("forward", "backward"), min_length=1)
    turns: int = Field(3, ge=1)  # without balancing, and as many with it
    repeats: int = Field(3, ge=2)  # each way
    engage_rad: float = Field(math.radians(126), ge=0, lt=2 * math.pi)  # phase of the circle at which it begins
    gamma_max_rad: float = Field(math.radians(8), gt=0)  # which balancing may turn the phase angle to
    gamma_slew_rad_s: float = Field(math.radians(25), gt=0)
    beyond_torque: bool = False  # a gamma_max that takes the motor's torque away is meant
    model: Literal["adopted", "default"] = "adopted"  # what the controller is told of the motor
    settle_s: float = Field(2.0, gt=0)  # after the motor has taken the shaft
    bin_s: float = Field(0.01, gt=0, le=0.1)  # of which means are taken around the circle
    count_rad: float = Field(2 * math.pi / 4096, gt=0)  # of the encoder
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples

    @property
    def turn_s(self) -> float:
        """Time of a turn of the circle."""
        return 1 / self.circle_hz

    @property
    def signs(self) -> tuple[tuple[str, int], ...]:
        """The ways with their signs."""
        return tuple((way, 1 if way == "forward" else -1) for way in self.ways)
