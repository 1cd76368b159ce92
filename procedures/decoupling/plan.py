"""Settings of the decoupling of axes."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from bench.plan import BenchPlan
from procedures.stages.pairs import Moved


class Plan(BenchPlan):
    """Settings, SI: one axis follows a sine while the others are held, one after the other."""

    moved: Moved = "all"  # which axes are moved, one after the other
    integrators: str = "on"  # of the rig's capabilities.settings.integrators; "": as the controller is set
    model: Literal["default", "inductance-map", "static-characteristics"] = (
        "default"  # whose map the controller shares by
    )
    parameters: dict[str, float] = Field(default_factory=dict)  # of the controller, once the axes are held
    amplitude_m: float = Field(10e-3, gt=0)
    amplitude_rad: float = Field(math.radians(200), gt=0)
    period_s: float = Field(5.0, gt=0)
    periods: int = Field(9, ge=4)  # that are looked at, after one that is not
    nudges: int = Field(
        4, ge=2, multiple_of=2
    )  # periods in which the held axis is moved a little, after one, slow and fast
    nudge_m: float = Field(20e-6, gt=0)
    nudge_rad: float = Field(0.0126, gt=0)
    settle_s: float = Field(1.0, ge=0.1)  # at rest, before each
    sliding: float = Field(0.5, gt=0, lt=1)  # share of the greatest speed, above which the moved axis counts as sliding
    smooth_hz: float = Field(5.0, gt=0)  # at which a Gauss filter of the cross force lets half through
    force_scale: float = Field(0.025, ge=0)  # standard uncertainty, share, of a newton of the controller's map
    torque_scale: float = Field(0.04, ge=0)  # likewise of a newton metre
    inertia: dict[str, float] = Field(
        default_factory=dict
    )  # by axis, kg or kg m^2, where it is not that of the whole machine
    max_hidden: float = Field(0.25, gt=0)  # counts of the encoder that friction may hold against the loop
    max_miss: float = Field(0.05, gt=0)  # share that the moved axis' sine may be off in size
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
