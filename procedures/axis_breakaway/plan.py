"""Settings of the breakaway of a stage's axes."""

from __future__ import annotations

from pydantic import Field

from bench.plan import BenchPlan


class Plan(BenchPlan):
    """Settings, SI. Numbers that are there twice are for axes in m and in rad."""

    axes: tuple[str, ...] = ()  # of the rig; none: all that it positions
    ramp_m_s: float = Field(1e-4, gt=0)  # of the set point, while the axis sticks
    ramp_rad_s: float = Field(2e-3, gt=0)
    span_m: float = Field(1.2e-3, gt=0)  # of a slide: more than both friction bands
    span_rad: float = Field(0.045, gt=0)
    pull_rad: float = Field(2.2e-3, ge=0)  # to each side, of the set point around beside an axis along; 0: not pulled
    slide_rad_s: float = Field(0.02, gt=0)  # around, before a helix is ramped
    repeats: int = Field(5, ge=4)  # of everything, at as many places
    spread_m: float = Field(5e-3, ge=0)  # to each side of the middle of the travel
    mass: str = "M2"  # over a pulley
    lever_mass: str = "M1"  # on a lever
    helix: tuple[float, ...] = (0.4, 1.0, 2.5)  # both at once: force along over breakaway by torque over breakaway
    rest_s: float = Field(0.5, gt=0)  # before each ramp
    saturation_share: float = Field(
        0.05, ge=0
    )  # tolerance of the current at which the map has iron saturate, half width
    max_apart: float = Field(0.15, gt=0)  # by which helices may break away elsewhere than one friction along the path
    max_u: float = Field(0.1, gt=0)  # standard uncertainty of a breakaway, as a share of it
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
