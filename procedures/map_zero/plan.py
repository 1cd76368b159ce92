"""Settings of the zeros of a reluctance machine's stators."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of how the shaft is let turn in, and of what is made of it, SI."""

    teeth: tuple[int, ...] = Field((0, 1, 2, 3), min_length=1)  # of the rotor, which a phase draws in one by one
    start_rad: float = Field(0.14, gt=0.02, lt=0.2)  # from where a phase is aligned, to either side
    levels_A: tuple[float, ...] = Field((2.0, 2.5, 3.0, 4.0), min_length=3)  # at which it is read
    growth: float = Field(1.06, gt=1.005, lt=1.3)  # of the current from one step of its ramp to the next
    first_A: float = Field(0.8, gt=0)  # where the ramp begins
    step_s: float = Field(0.08, ge=0.01)  # of each step of the ramp
    rest_s: float = Field(0.4, ge=0)  # at each level, before it is read
    read_s: float = Field(0.15, ge=0.05)  # at each level
    settle_s: float = Field(0.2, ge=0)  # held, before a phase draws
    max_spread_rad: float = Field(2e-3, gt=0)  # by which the zeros of levels may drift, from the first to the last
    max_band_rad: float = Field(0.03, gt=0)  # half of what both sides differ by, at the last level
