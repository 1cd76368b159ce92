"""Settings of the zeros of encoders."""

from __future__ import annotations

import math

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings, SI. Each current is stepped to either sign, `repeats` times at each of two places."""

    motors: tuple[str, ...] = ()  # by the rig's names; none: all whose zero the controller keeps
    observer: str = "position"  # of the rig's capabilities.settings.observer, where it has any
    current_A: float = Field(1.0, gt=0)  # either way, along the field and across it
    repeats: int = Field(5, ge=3)  # of + and -, of each current at each place
    window_s: float = Field(0.2, ge=0.05)  # of each mean, captured
    time_constants: float = Field(8.0, ge=3)  # of the slowest part of the loop, waited for after each step
    least_s: float = Field(0.1, ge=0.02)  # waited for at least
    trial_rad: float = Field(
        math.radians(5), ge=0, le=math.radians(20)
    )  # by which each zero is changed to see it act; 0: not
    move_s: float = Field(1.0, ge=0.1)  # for the way from place to place, before the loop settles
    rate_hz: float | None = Field(None, gt=0)  # of captures; none: the nearest to 35 kHz
    max_unsettled: float = Field(
        2e-3, gt=0
    )  # of the step: how far the answer may differ from half of a window to the other
    max_moved_rad: float = Field(1.5e-3, gt=0)  # electrical, that the mover may stand elsewhere under either sign
    max_off: float = Field(0.02, gt=0)  # of the step, that the current may be off what was asked for
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
