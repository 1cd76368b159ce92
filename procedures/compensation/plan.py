"""Settings of the dwells and of the switch."""

from __future__ import annotations

from pydantic import Field

from bench.units import RPM
from procedures.amb_rotor.machine import Variant
from procedures.unbalance import plan as unbalance

SAME = 1e-6  # of a speed


class Plan(unbalance.Plan):
    """Settings, SI; those of `unbalance` and some more."""

    variants: tuple[Variant, ...] = Field(("off", "corrected"), min_length=2)
    # of these, where there is a dwell, the observer as printed too
    literal_rad_s: tuple[float, ...] = (2000 / RPM, 10000 / RPM)
    judged_to_rad_s: float = Field(10001 / RPM, gt=0)  # the range of T 3.5; above it the reduction is told, not judged
    switch_rad_s: float = Field(10000 / RPM, gt=0)
    before_s: float = Field(0.2, ge=0.05)
    after_s: float = Field(0.8, ge=0.2)

    def at(self, speed: float) -> tuple[Variant, ...]:
        """With the literal observer where the plan says so."""
        tried = any(abs(speed / s - 1) < SAME for s in self.literal_rad_s)
        return (*self.variants, "literal") if tried else self.variants
