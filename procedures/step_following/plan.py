"""Settings of the steps."""

from __future__ import annotations

import math

from pydantic import Field

from bench.plan import BenchPlan
from procedures.stages.tracks import Moved


class Plan(BenchPlan):
    """Settings, SI. Axes go from the first place to the second and back, so often; the controller shapes the way."""

    moved: Moved = "all"  # which axes: all, or those that measure a stroke or an angle
    places_m: tuple[float, float] = (-10e-3, 10e-3)
    angles_rad: tuple[float, float] = (0.0, math.radians(200))
    together: bool = True  # and once more with all axes at once
    integrators: str = "on"  # of the rig's capabilities.settings.integrators
    lead: int = Field(2, ge=0)  # there and back before anything counts: loops remember where they come from
    repeats: int = Field(5, ge=2)  # there and back
    before_s: float = Field(0.05, ge=0.01, le=1)  # recorded before a step
    dwell_s: float = Field(5.0, gt=0.3, le=60)  # from a step to the next one
    rest_s: float = Field(0.2, gt=0, le=5)  # at its end, in which the axis is to stand
    band: float = Field(0.02, gt=0, lt=0.5)  # of settling, share of the step
    max_moved: float = Field(1e-3, gt=0)  # share of the step by which an axis that rests may move
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
