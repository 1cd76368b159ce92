"""Settings of the delays of position sensors."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the injections, SI."""

    observer: str = "position"  # of the rig's capabilities.settings.observer, where it has any
    low_hz: float = Field(120.0, gt=0)
    high_hz: float = Field(600.0, gt=0)
    lines: int = Field(5, ge=3)  # at equal steps of the logarithm, each into every loop
    share: float = Field(0.4, gt=0, lt=1)  # of a loop's limit, that a sine's force takes
    periods: int = Field(20, ge=4)  # of each line, at least
    record_s: float = Field(0.5, ge=0.1)  # of each line, at least
    start_s: float = Field(0.15, ge=0.05)  # of each sine, before it is captured
    settle_s: float = Field(1.0, ge=0.1)  # after the lift
    rate_hz: float | None = Field(None, gt=0)  # of captures; none: that of the loops
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
    max_u_s: float = Field(2e-6, gt=0)  # standard uncertainty of a delay
    max_condition: float = Field(30.0, gt=1)  # of the currents of all loops' sines: how far they are from each other's
