"""Settings of the steps."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the steps, SI."""

    steps_at: tuple[str, ...] = Field(("R1_d",), min_length=1)  # places of capabilities.current_steps
    size_A: float = Field(3.0, gt=0, le=20)  # of the large step
    small_A: float = Field(0.3, gt=0, le=20)  # of the small one, which is to touch no limit
    repeats: int = Field(10, ge=4)  # of the large step, up and back
    small_repeats: int = Field(30, ge=4)  # of the small one
    lead_s: float = Field(3e-3, ge=2e-3)  # from the start of a capture to the step at least
    hold_s: float = Field(
        15e-3, ge=5e-3
    )  # from the step to the step back at least, and from there to the capture's end
    spare_s: float = Field(15e-3, ge=0)  # of a capture, for what two writes take on their way
    tries: int = Field(3, ge=1, le=10)  # of a capture that the step or the step back is not in
    response_s: float = Field(2e-3, ge=0.5e-3)  # after a step: what the response is taken of
    settle_s: float = Field(1.0, ge=0)  # before all: the mover rocks in its rings when it is taken hold of
    push_s: float = Field(0.06, ge=0.02)  # how long the mover is looked at before the large step, and under it
    max_push_m: float = Field(5e-6, gt=0)  # that a position which such a step must leave alone may move
    max_turn_rad: float = Field(2e-3, gt=0)  # that an angle which such a step must leave alone may turn
    max_unsettled: float = Field(0.01, gt=0)  # of a step: how far its end may be off its size or still drift
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
