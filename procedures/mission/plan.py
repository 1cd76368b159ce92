"""Settings of the mission."""

from __future__ import annotations

import math

from pydantic import Field

from bench.plan import BenchPlan

TIMES_S = 10.0  # that a stage of a mission may take at most


class Plan(BenchPlan):
    """Settings, SI. The mover goes from the first place and angle to the second and back, so often."""

    observer: str = "position"  # of the rig's capabilities.settings.observer; the paper's is "paper"
    places_m: tuple[float, float] = (8e-3, 14e-3)
    angles_rad: tuple[float, float] = (0.0, math.radians(80))
    place_rate_m_s: float = Field(0.5, gt=0)
    place_rise_m_s2: float = Field(40.0, gt=0)
    angle_rate_rad_s: float = Field(18.0, gt=0)
    angle_rise_rad_s2: float = Field(300.0, gt=0)
    repeats: int = Field(4, ge=2)  # there and back
    dwell_s: float = Field(0.5, gt=0.1, le=TIMES_S)  # from the command of a move to the next one
    spare_s: float = Field(0.02, ge=0, le=TIMES_S)  # of each move in a capture, for what its commands take on their way
    rest_s: float = Field(0.15, ge=0.05)  # of it, at its end: the mover stands
    turn_s: float = Field(1.0, gt=0, le=TIMES_S)  # for the turn to the first angle in the rings
    lift_s: float = Field(1.0, gt=0, le=TIMES_S)  # captured from just before the lift; the gate has to pass meanwhile
    patience_s: float = Field(3.0, gt=0, le=TIMES_S)  # that the gate is waited for
    settle_s: float = Field(0.5, gt=0, le=TIMES_S)  # before the first move of a capture
    captures: int = Field(1, ge=1)  # into which the repeats are divided; each is uploaded while the mover is held
    rate_hz: float = Field(35e3, gt=1e3)
    currents: bool = True  # capture the bearings' currents, too
    smooth_s: float = Field(6e-4, gt=0)  # standard deviation of the Gauss window that noise is averaged with
