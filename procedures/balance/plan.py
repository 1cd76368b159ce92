"""Settings of a balancing."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan
from bench.units import RPM
from procedures.amb_rotor.machine import Law


class Plan(BenchPlan):
    """Settings of a balancing, SI."""

    law: Law = ""
    speeds_rad_s: tuple[float, ...] = Field((4000 / RPM, 10000 / RPM), min_length=1)  # of every run
    slow_rad_s: float = Field(300 / RPM, ge=0)  # 0: no slow roll
    slow_s: float = Field(10.0, ge=1)
    settle_s: float = Field(1.5, ge=0.2)
    dwell_s: float = Field(2.0, ge=0.5)
    capture_s: float = Field(0.4, ge=0.05)
    repeat: bool = True  # the lowest speed again at the end of each run
    planes: tuple[str, ...] = ()  # two of the rig's, which take the weights; none: both, where it has two
    trial_kg: tuple[float, float] = (1e-4, 1e-4)  # inboard, outboard
    trial_angle_rad: tuple[float, float] = (0.0, 0.0)  # on the planes' scales
    leave: bool = False  # trial weights stay on; else each is taken off after its run
    corrections: int = Field(2, ge=0, le=3)  # at most
    positions: int = Field(0, ge=0, le=360)  # equally spaced, the first at the scale's zero; 0: any angle
    grade_m_s: float = Field(2.5e-3, gt=0)  # G2.5
    service_rad_s: float = Field(15000 / RPM, gt=0)  # the highest, for the permissible residual unbalance
    max_share: float = Field(0.5, gt=0, le=0.9)  # of the least clearance: where a predicted response may reach
    refit_u_kg_m: float = Field(0.0, ge=0)  # of the shaft's own unbalance, each time a weight has been fixed
    bending_hz: float = Field(650.0, ge=0)  # first bending mode of the free shaft; 0: rigid
    bearings: Literal["adopted", "plan"] = "adopted"  # as in unbalance
    beta_share: float = Field(0.05, ge=0)
    offset_u_m: float = Field(10e-6, ge=0)
    max_lost: float = Field(1e-3, ge=0)
    max_speed_error: float = Field(0.01, gt=0)
