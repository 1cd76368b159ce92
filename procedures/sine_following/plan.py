"""Settings of the sines."""

from __future__ import annotations

import math

from pydantic import Field

from bench.plan import BenchPlan
from procedures.stages.tracks import Moved


class Plan(BenchPlan):
    """Settings, SI. Set points go about zero by the controller's own sine."""

    moved: Moved = "all"  # which axes: all, or those that measure a stroke or an angle
    amplitude_m: float = Field(10e-3, gt=0)
    amplitude_rad: float = Field(math.radians(200), gt=0)
    period_s: float = Field(5.0, gt=0.2, le=60)
    together: bool = True  # and once more with all axes at once
    lead_turns: float = Field(
        0.25, ge=0, lt=1
    )  # by which the first axis leads the others then, where its wave has a phase
    integrators: str = "on"  # of the rig's capabilities.settings.integrators
    shaped_s: float = Field(
        1.0, ge=0, le=10
    )  # at first, in which set points go to the sine by the controller's rate and rise
    lead: int = Field(1, ge=1)  # periods before those that count
    periods: int = Field(9, ge=1)
    max_off: float = Field(0.01, gt=0, lt=0.5)  # share of the amplitude by which set points may be off the plan's sine
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
