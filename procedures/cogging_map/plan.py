"""Settings of the map of cogging."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the sweeps, SI."""

    loops: Literal["all", "along", "around"] = "all"  # of those along which a motor's current is known
    observer: str = "position"  # of the rig's capabilities.settings.observer, where it has any
    parameters: dict[str, float] = Field(default_factory=dict)  # of the controller, once it levitates
    constants: Literal["stated", "calibration"] = "stated"  # of the motors: the rig file's, or by actuator-constant
    zeros: Literal["stated", "calibration"] = "stated"  # of the encoders: as the rig file states, or by encoder-zero
    from_m: float = 6e-3  # where the map along begins, out of the touchdown rings
    turns_along: int = Field(1, ge=1)  # of the current's phase that it goes along
    speed_m_s: float = Field(3e-3, gt=0, le=0.02)
    from_rad: float = 0.0  # where the map around begins
    turns_around: int = Field(1, ge=1)  # of the shaft
    speed_rad_s: float = Field(0.4, gt=0, le=1.0)
    lead: float = Field(0.05, gt=0)  # share of a map that a sweep goes on either side of it
    sweeps: int = Field(2, ge=2)  # each way, of each setting of the feedforward
    feedforward: Literal["both", "as it is"] = (
        "both"  # with what the controller adds against cogging and without, or with it
    )
    settle_s: float = Field(1.0, ge=0.1)  # before each sweep
    min_samples: int = Field(20, ge=8)  # of the telemetry, in a period of the highest harmonic
    min_signal: float = Field(10.0, gt=1)  # of the first harmonic, in its standard uncertainty
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
