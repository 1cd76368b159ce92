"""Settings of the injections."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan
from procedures.amb_rotor.machine import Law


class Plan(BenchPlan):
    """Settings of the injections, SI."""

    law: Law = ""
    axes: tuple[str, ...] = ()  # by the rig's names; none: all into which the controller injects
    speeds_rad_s: tuple[float, ...] = Field((0.0,), min_length=1)
    amplitude_A: float = Field(4e-3, gt=0)  # of each line of a comb, 0-pk
    sine_A: float | None = Field(
        None, gt=0
    )  # where the controller makes one sine at a time; 1.5 % of the bias if not given
    low_hz: float = Field(2.0, gt=0)
    middle_hz: float = Field(256.0, gt=0)  # up to here the odd multiples of low_hz; above it every high_step_hz
    high_step_hz: float = Field(16.0, gt=0)
    high_hz: float = Field(2000.0, gt=0)
    scan_step_hz: float = Field(4.0, ge=0)  # of the lines above middle_hz that look for modes not named; 0: none
    modes_hz: tuple[float, ...] = ()  # bending modes, about which a finer grid is laid
    mode_within_hz: float = Field(26.0, gt=0)  # to either side
    mode_damping: float = Field(2e-3, gt=0)  # least that is expected of them
    periods: int = Field(4, ge=3)  # of the survey
    refined_periods: int = Field(8, ge=4)
    settle_s: float = Field(8.0, ge=0.5)  # under the law, before anything is injected
    start_s: float = Field(0.5, ge=0.1)  # of each injection
    survey_start_s: float = Field(1.5, ge=0.1)  # of the survey: a slow integrator answers its lowest lines
    rate_hz: float | None = Field(None, gt=0)  # of captures; none: the nearest to 10 kHz
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
    max_speed_error: float = Field(0.01, gt=0)  # share of the speed
    max_change: float = Field(0.05, gt=0)  # of S_max, at half the amplitude: linear enough
    min_coherence: float = Field(0.9, gt=0, lt=1)  # at the lines about the peak
