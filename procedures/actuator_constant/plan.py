"""Settings of the constants of actuators."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the injections and of the added currents, SI."""

    loops: Literal["all", "along", "around"] = "all"  # of those along which a motor's current is known
    observer: str = "position"  # of the rig's capabilities.settings.observer, where it has any
    parameters: dict[str, float] = Field(default_factory=dict)  # of the controller, once it levitates
    zeros: Literal["stated", "calibration"] = "stated"  # of the encoders: as the rig file states, or by encoder-zero
    places_m: tuple[float, ...] = Field(
        (9.375e-3, 12.5e-3), min_length=2
    )  # along: where cogging's slope has either sign
    angles_rad: tuple[float, ...] = Field((0.0, math.radians(3.75)), min_length=2)  # around: the same
    low_hz: float = Field(30.0, gt=0)
    high_hz: float = Field(240.0, gt=0)
    lines: int = Field(7, ge=5)  # at each place, at equal steps of the logarithm
    share: float = Field(0.5, gt=0, lt=1)  # of a loop's limit, that a sine's force takes at most
    counts: float = Field(16.0, gt=0)  # of the converter that shows the loop, that an amplitude has at most
    least_counts: float = Field(10.0, gt=0)  # lines end where the share of the limit no longer makes so many
    amplitude: dict[str, float] = Field(default_factory=dict)  # m or rad, by loop, in the place of that
    periods: int = Field(6, ge=4)  # of each line, at least
    record_s: float = Field(0.6, ge=0.1)  # of each line, at least
    settle_s: float = Field(1.0, ge=0.1)  # after a move
    start_s: float = Field(0.15, ge=0.05)  # of each sine, at least
    time_constants: float = Field(3.0, ge=2)  # of the loop's integrator, for which a sine has gone on before
    added_A: float = Field(1.0, ge=0)  # to one of two motors along a loop, either way; 0: their ratio is not looked at
    pairs: int = Field(5, ge=3)  # of that, either way
    added_settle: float = Field(5.0, ge=3)  # time constants of the loop's integrator after each
    rest_s: float = Field(0.5, ge=0.1)  # over which means are taken then
    added_inertia: bool = (
        False  # the ring is put on, and what turns looked at again: its inertia by it, not the rig file's
    )
    rate_hz: float | None = Field(None, gt=0)  # of captures; none: the nearest to 35 kHz
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
    min_signal: float = Field(10.0, gt=1)  # of a line, in its standard uncertainty
