"""Settings of a passage through the speeds, of both directions and of the run-up."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan
from bench.units import RPM
from procedures.amb_rotor.machine import Law


class Passing(BenchPlan):
    """Settings of both directions, SI."""

    law: Law = ""
    parameters: dict[str, float] = Field(default_factory=dict)  # of the controller, while the speeds are passed
    top_rad_s: float = Field(14000 / RPM, gt=0)
    bottom_rad_s: float = Field(600 / RPM, gt=0)
    running_rad_s: float = Field(14000 / RPM, gt=0)  # from which criticals must stand off
    speeds_rad_s: tuple[float, ...] = Field((3000 / RPM, 8000 / RPM, 13000 / RPM), min_length=1)  # captures, vectors
    slow_rad_s: float = Field(300 / RPM, ge=0)  # 0: no slow roll
    slow_s: float = Field(10.0, ge=1)
    settle_s: float = Field(1.5, ge=0.2)
    capture_s: float = Field(0.3, ge=0.05)
    rate_hz: float | None = Field(None, gt=0)  # of captures; none: the nearest to 10 kHz
    orders: int = Field(4, ge=1, le=10)  # that the full spectrum must show
    blocks: int = Field(150, ge=30, le=1000)  # of equal width in speed
    bearings: Literal["adopted", "plan"] = (
        "adopted"  # what is known of them: the adopted bearing-model, where there is one
    )
    beta_share: float = Field(0.05, ge=0)  # half width: how far the controller's betas may be off the bearings'
    offset_u_m: float = Field(10e-6, ge=0)  # of its magnetic offsets, standard uncertainty
    max_lost: float = Field(1e-3, ge=0)  # share of the samples
    max_speed_error: float = Field(0.01, gt=0)  # share of the speed, at slow roll

    @property
    def rate_rad_s2(self) -> float:
        """Of the drive's ramp; 0 where it coasts."""
        return 0.0


class Plan(Passing):
    """Settings of the run-up, SI."""

    acceleration_rad_s2: float = Field(24.5, gt=0)  # 14 000 r/min in a minute

    @property
    def rate_rad_s2(self) -> float:
        """Of the drive's ramp."""
        return self.acceleration_rad_s2
