"""Settings of the dwells."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan
from bench.units import RPM
from procedures.amb_rotor.machine import Law, Variant


class Plan(BenchPlan):
    """Settings of the dwells, SI."""

    law: Law = ""  # of the controller's; as it is set where none is named
    speeds_rad_s: tuple[float, ...] = Field((2000 / RPM, 4000 / RPM, 7000 / RPM, 10000 / RPM), min_length=1)
    variants: tuple[Variant, ...] = Field(("off",), min_length=1)
    slow_rad_s: float = Field(300 / RPM, ge=0)  # 0: no slow roll
    slow_s: float = Field(10.0, ge=1)
    settle_s: float = Field(1.5, ge=0.2)  # at a speed, and with a setting
    dwell_s: float = Field(3.0, ge=0.5)
    capture_s: float = Field(0.3, ge=0.05)
    rate_hz: float | None = Field(None, gt=0)  # of captures; none: the nearest to 10 kHz
    orders: int = Field(4, ge=1, le=10)  # that the full spectrum must show
    repeat: bool = True  # the lowest speed again, at the end
    bearings: Literal["adopted", "plan"] = (
        "adopted"  # what is known of them: the adopted bearing-model, where there is one
    )
    beta_share: float = Field(0.05, ge=0)  # half width: how far the controller's betas may be off the bearings'
    offset_u_m: float = Field(10e-6, ge=0)  # of its magnetic offsets, standard uncertainty
    max_lost: float = Field(1e-3, ge=0)  # share of a dwell's samples
    max_speed_error: float = Field(0.01, gt=0)  # share of the speed

    @property
    def observed(self) -> bool:
        """Whether disturbances are compensated in some variant."""
        return any(v != "off" for v in self.variants)

    def at(self, speed: float) -> tuple[Variant, ...]:
        """Variants at a speed in rad/s."""
        del speed
        return self.variants

    @property
    def dwells(self) -> int:
        """How many there are, the repeat not counted."""
        return sum(len(self.at(s)) for s in self.speeds_rad_s)
