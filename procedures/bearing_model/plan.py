"""Settings of the grid of positions."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan
from procedures.amb_rotor.machine import Law


class Plan(BenchPlan):
    """Settings, SI. Positions are a grid of the centre of mass in y and z, within a circle."""

    law: Law = ""  # of the controller's, one that holds a place exactly; as it is set where none is named
    spacing_m: float | None = Field(None, gt=0)  # a quarter of the radius where it is not given
    radius_m: float | None = Field(None, gt=0)  # most of what ring and set points leave where it is not given
    tilt_rad: float = Field(3e-4, gt=0)  # of the check of the wiring
    biases_A: tuple[
        float, ...
    ] = ()  # of each pass; T Table 2.2 is compared with the first; none: as the controller is set
    coupled: bool = True  # False: the operator has taken the coupling off
    settle_s: float = Field(0.6, gt=0)
    average_s: float = Field(0.5, ge=0.1)
    batches: int = Field(5, ge=2)  # parts of a step; longer than the loop's swings
    max_speed_m_s: float = Field(5e-6, gt=0)  # a shaft that moves faster is not at rest
    max_misfit: float = Field(0.005, gt=0)  # a position's residual over the mean load of its axis
    min_ratio: float = Field(20.0, gt=1)  # of the residual sums, over samples and over batch means
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
