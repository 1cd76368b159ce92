"""Settings of the map of inductances."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the pulses, of where they are given and of what is made of them, SI."""

    positions_m: tuple[float, ...] = Field((-13e-3, -10.5e-3, -6e-3, 0.0, 6e-3, 10.5e-3, 13e-3), min_length=5)
    angles_per_position: int = Field(4, ge=3)  # spread over the whole turn, each place another
    pulse_s: float = Field(0.02, ge=8e-3)  # of a pulse; its later part tells the resistance
    tail_s: float = Field(8e-3, ge=4e-3)  # captured after it, until no current is left
    trigger_V: float = Field(15.0, gt=0)  # of a phase's voltage, which begins its capture
    rate_hz: float | None = Field(None, gt=0)  # of captures; none: the greatest
    settle_s: float = Field(0.3, ge=0)  # before the lock
    rest_s: float = Field(0.1, ge=0.02)  # locked: how long the place is read
    max_residual: float = Field(5e-3, gt=0)  # of a flux, as a share of the aligned: what the formula may lack
    max_yield_rad: float = Field(5e-3, gt=0)  # by which the lock may turn under the greatest torque
    leakage_share: float = Field(
        5e-3, gt=0
    )  # by which leakages of phases may differ, beside what gains of readings make of it
    max_other_A: float = Field(0.06, gt=0)  # of the phases that have no pulse
    max_apart: float = Field(0.01, gt=0)  # by which fluxes up and down may differ, of their size
    weak: float = Field(0.8, gt=0, lt=1)  # share of the others' voltage that a pulse must have
