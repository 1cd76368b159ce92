"""Settings of the friction of a stage's axes."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.plan import BenchPlan


class Plan(BenchPlan):
    """Settings, SI. Numbers that are there twice are for axes in m and in rad."""

    axes: tuple[str, ...] = ()  # of the rig; none: all that it positions
    rates_m_s: tuple[float, ...] = Field((0.01, 0.015, 0.025, 0.035), min_length=2)  # ascending
    rates_rad_s: tuple[float, ...] = Field((2.0, 4.0, 8.0, 12.0), min_length=2)
    rise_m_s2: float = Field(1.0, gt=0)
    rise_rad_s2: float = Field(40.0, gt=0)
    window_m: float = Field(5e-3, gt=0)  # to each side of the middle of the travel: here forces are averaged
    turns: int = Field(1, ge=1)  # likewise
    settle_m_s: float = Field(0.2, gt=0)  # s at a rate before the window, axes in m
    settle_rad_s: float = Field(0.4, gt=0)
    repeats: int = Field(8, ge=4)  # of everything, at as many places of the other axes
    scale: Literal["loads", "map"] = "loads"  # what a force is known by: weights, or the controller's map alone
    mass: str = "M2"  # over a pulley
    lever_mass: str = "M1"  # on a lever
    load_rate_m_s: float = Field(0.02, gt=0)  # under loads
    load_rate_rad_s: float = Field(4.0, gt=0)
    map_share: float = Field(0.05, gt=0)  # tolerance of the controller's map, half width: with scale = "map"
    saturation_share: float = Field(
        0.05, ge=0
    )  # tolerance of the current at which the map has iron saturate, half width
    helix: bool = True  # both axes at once
    helix_m_s: float = Field(0.018, gt=0)
    helix_rad_s: tuple[float, ...] = Field((0.75, 2.25, 7.5), min_length=1)
    rest_s: float = Field(0.3, gt=0)  # before each pass
    max_uneven: float = Field(0.05, gt=0)  # by which the rate may differ from one half of a window to the other
    max_apart: float = Field(0.12, gt=0)  # of its Coulomb friction: what a helix may be off one friction along the path
    max_u: float = Field(0.1, gt=0)  # standard uncertainty of Coulomb friction, as a share of it
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
