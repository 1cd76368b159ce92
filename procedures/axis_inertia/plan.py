"""Settings of what a stage's axes move: mass and moment of inertia."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.plan import BenchPlan

Tones = tuple[tuple[float, float], ...]
Part = Literal["ring", "bar"]


class Plan(BenchPlan):
    """Settings, SI. Numbers that are there twice are for axes in m and in rad."""

    axes: tuple[str, ...] = ()  # of the rig; none: all that play sines
    tones_m: Tones = Field(((7e-3, 1.8), (1.5e-3, 4.0)), min_length=2)  # amplitude and Hz; the first one tells the mass
    tones_rad: Tones = Field(((0.8, 1.5), (0.1, 3.0)), min_length=2)
    part_m: Part = "bar"  # that is added, by its name among the known parts
    part_rad: Part = "ring"
    # Rate of the sines with the part on, as a share: from the root to the fourth root of J/(J + P).
    slower_m: float = Field(0.8, gt=0)
    slower_rad: float = Field(0.8, gt=0)
    repeats: int = Field(8, ge=4)  # of everything, at as many places
    spread_m: float = Field(5e-3, ge=0)  # to each side of the middle of the travel: where an axis in m stands meanwhile
    settle_s: float = Field(1.2, gt=0)  # of a sine, before it is recorded
    record_s: float = Field(2.6, gt=0)  # at least; whole periods of it are used
    saturation_share: float = Field(
        0.05, ge=0
    )  # tolerance of the current at which the map has iron saturate, half width
    delay_s: float = Field(7e-4, ge=0)  # of force behind what is asked for: half a period of the loops, and 0.2 ms
    delay_half_s: float = Field(4e-4, ge=0)  # its tolerance, half width
    max_apart: float = Field(0.05, gt=0)  # by which tones may differ, as a share
    max_rubbed: float = Field(0.2, gt=0)  # by which friction may differ with the part, as a share
    max_u: float = Field(0.03, gt=0)  # standard uncertainty, as a share
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
