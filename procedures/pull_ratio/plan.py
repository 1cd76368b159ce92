"""Settings of the set points."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings, SI. Every level is reached from below and from above, with both planes together and with each alone."""

    levels_m: tuple[float, ...] = Field(tuple(round(x * 1e-5, 9) for x in range(-2, 3)), min_length=3)
    pole: Literal["none", "calibration"] = "none"  # calibration: that of unstable-pole gives the force constant, too
    constants: Literal["none", "calibration"] = (
        "none"  # calibration: those of bearing-constant give the pull of each plane
    )
    observer: str = "position"  # of the rig's capabilities.settings.observer, where it has any
    place_m: float | None = None  # along the shaft; none: the middle that capabilities.hold states
    rest_s: float = Field(1.5, ge=0)  # at the place, before the first level
    step_m: float = Field(2.5e-6, gt=0)  # on the way from level to level
    step_s: float = Field(0.02, ge=0)  # between two such steps
    settle_s: float = Field(0.1, ge=0)  # at each level, at least
    time_constants: float = Field(5.0, ge=2)  # of the loops' integrator, waited for at each level
    average_s: float = Field(0.05, ge=0.01)  # of each mean, captured
    rate_hz: float | None = Field(None, gt=0)  # of captures; none: the nearest to 35 kHz
    max_position_m: float = Field(2e-7, gt=0)  # settled: how far a mean reading may be off its set point
    max_ways_A: float = Field(
        10e-3, gt=0
    )  # between the mean currents of a level from below and from above, beside their noise
    max_misfit_A: float = Field(10e-3, gt=0)  # of mean currents about the straight line, root mean square
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
