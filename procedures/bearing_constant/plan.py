"""Settings of the bearing constants."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of what hangs where, SI."""

    masses: tuple[str, ...] = ()  # labels of the rig file, two; none: the lightest and the heaviest that it has
    hooks: tuple[str, ...] = ()  # where they hang, one or two; none: the two that are farthest apart
    rounds: int = Field(2, ge=2)  # of six visits each
    observer: str = "position"  # of the rig's capabilities.settings.observer, where it has any
    angle_rad: float = 0.0  # at which the mover is held
    place_m: float | None = None  # along; none: where its centre of mass is in the middle between both planes
    settle_s: float = Field(1.5, ge=0.2)  # after each lift, at least
    time_constants: float = Field(10.0, ge=5)  # of the slowest integrator, for which is waited then
    average_s: float = Field(0.5, ge=0.1)
    rate_hz: float | None = Field(None, gt=0)  # of captures; none: the nearest to 35 kHz
    max_off_m: float = Field(1e-7, gt=0)  # mean of a radial reading off its set point
    max_scatter: float = Field(3e-3, gt=0)  # of a visit's force, as a share of the heaviest weight
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
