"""Settings of the steps."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan

Axis = Literal["y", "z", "x"]


class Plan(BenchPlan):
    """Settings of the steps, SI."""

    axes: tuple[Axis, ...] = Field(("y", "z"), min_length=1)
    sizes_m: tuple[float, ...] = Field((10e-6, 20e-6), min_length=2)  # one alone says nothing of linearity
    speeds_rad_s: tuple[float, ...] = Field((0.0,), min_length=1)
    repeats: int = Field(2, ge=2)  # of: up, back, down, back
    a: dict[str, float | str] = Field(
        default_factory=dict
    )  # parameters of the controller, or a named setting by its kind
    b: dict[str, float | str] = Field(default_factory=dict)  # the other setting; empty: nothing is compared
    names: tuple[str, str] = ("A", "B")
    warm: dict[str, float | str] = Field(default_factory=dict)  # on top of either setting until it is warm
    warm_s: float = Field(4.0, ge=0)
    settle_s: float = Field(5.0, ge=0.1)  # with the setting itself
    model_error: float = Field(
        0.0, gt=-0.5, lt=1.0
    )  # share by which the controller's betas and offsets are made too large
    rest_s: float = Field(0.3, ge=0.1)  # before each step
    record_s: float | None = Field(None, ge=0.2)  # after it; by default until the law's integrator has arrived
    band: float = Field(0.02, gt=0)  # of settling, as a share of the step
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
    max_speed_error: float = Field(0.02, gt=0)  # share of the speed
