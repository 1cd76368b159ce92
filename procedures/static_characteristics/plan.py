"""Settings of the static characteristics."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of where the shaft is held, of the currents and of what is made of the readings, SI."""

    positions_m: tuple[float, ...] = Field((-13e-3, -6.5e-3, 0.0, 6.5e-3, 13e-3), min_length=3)
    angles_per_position: int = Field(3, ge=2)  # spread over the whole turn, each place another
    levels_A: tuple[float, ...] = Field((1.5, 3.0, 5.0), min_length=2)  # of one phase after the other
    settle_s: float = Field(0.3, ge=0)  # before the load cells take the shaft
    window_s: float = Field(0.2, gt=0)  # of readings by a channel, whose mean counts
    max_residual: float = Field(0.01, gt=0)  # rms of a load, as a share of the greatest: what the formula may lack
    max_held: float = Field(1.0, gt=0)  # of friction in a reading, as a share of the greatest load at the least current
    far: float = Field(12.0, gt=0)  # times the scatter of all from which a reading is off
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
