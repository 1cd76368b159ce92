"""Settings of loads on the axes of a stage."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.plan import BenchPlan


class Plan(BenchPlan):
    """Settings, SI. Numbers that are there twice are for axes in m and in rad."""

    axes: Literal["both", "along", "around"] = "both"  # those that known loads pull at both ways
    masses: tuple[str, ...] = Field(("M2", "M3"), min_length=1)  # over a pulley, ascending
    lever_masses: tuple[str, ...] = Field(("M2", "M3"), min_length=1)  # on a lever, ascending
    static: bool = True  # without integrators: each load, approached from both sides
    disturbed: bool = True  # with integrators: the greatest load, put on and taken off
    phases: int = Field(4, ge=4, multiple_of=2)  # set points, spread over one count of the encoder
    lead_m: float = Field(1.2e-3, gt=0)  # how far the axis is moved past, before it is moved back
    lead_rad: float = Field(0.045, gt=0)
    slow_m_s: float = Field(6e-4, gt=0)  # of moving back
    slow_rad_s: float = Field(0.02, gt=0)
    cool_s: float = Field(15.0, ge=0)  # without load after all of them, since windings warm while they carry
    settle_s: float = Field(0.4, gt=0)
    average_s: float = Field(0.3, ge=0.1)
    rest_s: float = Field(3.0, ge=0.5)  # with integrators, before a disturbance
    before_s: float = Field(0.2, ge=0.05)  # of a disturbance
    after_s: float = Field(5.0, ge=1)  # after a load: the error then, and the peak until then
    look_s: float = Field(0.2, ge=0.05)  # over which that error is averaged
    max_apart: float = Field(0.04, gt=0)  # relative, of the stiffness by each mass
    max_drift_m: float = Field(3e-6, gt=0)  # at rest, from the first half of the average to the second
    max_drift_rad: float = Field(1.5e-3, gt=0)
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
