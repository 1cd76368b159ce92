"""Parameters of the one-axis machine: the names and the order of the structs in `oneaxis.h`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlantParams:
    """The plant. Force of the coils: `beta` ((i_p / (gap - y))^2 - (i_n / (gap + y))^2); reading = gain * value + offset."""

    mass: float = 4.0
    gravity: float = 9.81
    beta: float = 1.5e-6
    gap: float = 5e-4
    clearance: float = 2.5e-4
    current_rate: float = 6000.0  # rad/s, of the closed current loops
    current_limit: float = 12.0
    position_gain: float = 1.0
    position_offset: float = 0.0
    position_noise: float = 1e-7
    current_gain: tuple[float, float] = (1.0, 1.0)
    current_offset: tuple[float, float] = (0.0, 0.0)
    current_noise: float = 3e-3
    trip_current: float = 14.0
    lost_height: float = 2.3e-4
    lost_time: float = 0.02


@dataclass(frozen=True)
class ControlParams:
    """The law's parameters: what `[parameters]` of the rig file may set."""

    bias: float = 3.0
    kp: float = 20e3
    kd: float = 40.0
    ki: float = 400e3
    ref: float = 0.0
    lift_time_s: float = 0.5
    derivative_hz: float = 1000.0
    current_limit: float = 12.0
