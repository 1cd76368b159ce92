"""Settings of the map of runout."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the turns, SI."""

    observer: str = "position"  # of the rig's capabilities.settings.observer, where it has any
    parameters: dict[str, float] = Field(default_factory=dict)  # of the controller, once it levitates
    places_m: tuple[float, ...] = Field((8e-3, 11e-3, 14e-3), min_length=1)  # along, at which it is turned
    speed_rad_s: float = Field(0.8, gt=0, le=2.0)
    lead_rad: float = Field(0.3, gt=0)  # that it turns on either side of a whole turn
    turns: int = Field(2, ge=2)  # each way, at each place
    settle_s: float = Field(0.5, ge=0.1)  # before each turn
    max_reading_m: float = Field(3e-6, gt=0)  # at one a turn, that the loops may leave of the readings
    max_other: float = Field(
        0.1, gt=0, lt=1
    )  # share that may turn the other way, of the greatest that turns with the shaft
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
