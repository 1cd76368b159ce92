"""Settings of the gate's and the catch's margins."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from bench.plan import BenchPlan

TURNED = (-135, -45, 45, 135)


class Plan(BenchPlan):
    """Settings, SI. Levitated, at every place and angle of a grid."""

    observer: str = "position"  # of the rig's capabilities.settings.observer; "": as the controller is set
    places_m: tuple[float, ...] = Field((8e-3, 11e-3, 14e-3), min_length=1)
    angles_rad: tuple[float, ...] = Field(tuple(math.radians(a) for a in TURNED), min_length=1)
    windows: int = Field(10, ge=9)  # at each place, each of the gate's time
    settle_s: float = Field(
        1.0, ge=0.1
    )  # after a move: radial integrators forget within 74 ms, that of an angle in 0.25 s
    trial: bool = True  # lift with one probe after the other beyond the gate: it must not pass
    trial_share: float = Field(1.2, gt=1)  # of the gate, that a set point goes to
    trial_gates: float = Field(1.6, ge=1.2)  # of the gate's time, that it stays there
    rise_s: float = Field(0.05, ge=0)  # of it, until the shaft is there
    pulse_s: float = Field(0.01, gt=0)  # so short a time beyond the gate must keep it shut, too
    pulses: int = Field(6, ge=2)  # in the time of a trial
    patience_s: float = Field(3.0, gt=0)  # that the gate is waited for, once nothing keeps it shut
    smooth_s: float = Field(6e-4, gt=0)  # Gauss window over readings, for how fast the shaft goes
    pole: Literal["stated", "calibration"] = "stated"  # of the shaft: by the rig file, or by unstable-pole
    max_drift_m: float = Field(1e-6, gt=0)  # of a probe's mean, from the first windows to the last ones of a place
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
