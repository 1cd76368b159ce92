"""Settings of the coast-down."""

from __future__ import annotations

from pydantic import Field

from procedures.run_up.plan import Passing


class Plan(Passing):
    """Settings of the coast-down, SI."""

    deceleration_rad_s2: float = Field(0.0, ge=0)  # 0: the drive gives no torque, and the shaft coasts

    @property
    def rate_rad_s2(self) -> float:
        """Of the drive's ramp; 0 where there is none."""
        return self.deceleration_rad_s2
