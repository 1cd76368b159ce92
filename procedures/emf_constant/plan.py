"""Settings of the emf constants of a mover's motors."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the moves and of what is made of them, SI."""

    motors: tuple[str, ...] = ()  # by the rig's names; none: all whose coils' voltages are read
    observer: str = "position"  # of the rig's capabilities.settings.observer, where it has any
    constants: Literal["none", "calibration"] = "none"  # what reciprocity is compared with: those of actuator-constant
    places_m: tuple[float, float] = (8e-3, 14e-3)  # ends of a move along
    angles_rad: tuple[float, float] = (0.0, 1.2)  # and around
    place_rate_m_s: float = Field(0.3, gt=0)
    place_rise_m_s2: float = Field(40.0, gt=0)
    angle_rate_rad_s: float = Field(18.0, gt=0)
    angle_rise_rad_s2: float = Field(300.0, gt=0)
    repeats: int = Field(4, ge=4)  # of each move, there and back
    settle_s: float = Field(0.3, ge=0.05)  # before each
    rest_s: float = Field(0.03, ge=0.01)  # captured after each, beside what a command takes
    rate_hz: float | None = Field(None, gt=0)  # of captures; none: four times that of the loops
    window_s: float = Field(5e-3, gt=0)  # over which the voltages' equation is averaged
    nameplate_share: float = Field(0.03, gt=0)  # by which a flux may differ from what is printed of it
    coil_share: float = Field(0.003, gt=0)  # by which a coil's flux may differ from its motor's
    max_u: float = Field(0.02, gt=0)  # standard uncertainty of a flux, as a share of it
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
