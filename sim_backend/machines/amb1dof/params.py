"""Parameters of the one-axis AMB: the names and the order of the structs in `amb1dof.h`. T is the thesis."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class PlantParams:
    """The plant, (4.18)-(4.19): m y'' = beta ((i_p/(gap - y))^2 - (i_n/(gap + y))^2) + load + harmonic sin(rate t + phase).

    Its sensors: reading = gain * value + offset. `literal_*`, `sample_factor`, `swapped` and `late` are what is wrong with
    the firmware.
    """

    mass: float = 0.4
    beta: float = 5e-6
    gap: float = 8e-4
    clearance: float = 3e-4
    load: float = 2.0
    harmonic: float = 1.0
    harmonic_rate: float = 80 * math.pi
    harmonic_phase: float = 0.0
    amplifier_rate: float = 2 * math.pi * 1000  # rad/s, of the closed current loops; 0: as fast as they are told
    delay: float = 0.0  # samples, from a reading to what the amplifiers are told
    position_gain: float = 1.0
    position_offset: float = 0.0
    position_noise: float = 0.4e-6 / 3
    current_gain: tuple[float, float] = (1.0, 1.0)
    current_offset: tuple[float, float] = (0.0, 0.0)
    current_noise: float = 2e-3
    trip_current: float = 3.0
    lost_position: float = 0.92 * 3e-4
    lost_time: float = 0.02
    literal_weights: float = 0.0
    literal_sign: float = 0.0
    sample_factor: float = 1.0
    swapped: float = 0.0
    late: float = 0.0


@dataclass(frozen=True)
class ControlParams:
    """The firmware's parameters: estimators, feedback (4.20), observers (4.21), (4.22), its model, injection.

    `estimator` closes the loop, `watched` is told (-1: the same one): 0 filtered difference, 1 one filter (4.23), 2 two that
    overlap (4.17), 3 full-order observer. `rule`: 0 Euler, 1 the first sample after a reset off, 2 weights that integrate
    exactly.
    """

    estimator: float = 2.0
    watched: float = -1.0
    degree: float = 7.0  # K
    window_s: float = 0.012  # eps of the two that overlap
    single_window_s: float = 0.004  # eps and t* of the one alone
    single_reset_s: float = 0.04
    rule: float = 0.0
    filter_hz: float = 500.0
    bias: float = 1.0
    kp: float = 92500.0  # 1/s^2: poles -50 +- 300 i
    kv: float = 100.0  # 1/s
    ref: float = 0.0
    compensate: float = 0.0
    harmonic_hz: float = 40.0
    pole_slow: float = -5.0
    pole_fast: float = -400.0
    pole_full: float = -2500.0
    exact_rotation: float = 0.0
    model_mass: float = 0.4
    model_beta: float = 5e-6
    model_gap: float = 8e-4
    inject_axis: float = -1.0
    inject_amplitude: float = 0.0  # A
    inject_hz: float = 30.0
    inject_lines: float = 1.0
    inject_step: float = 0.0
    lift_time_s: float = 0.5
    current_limit: float = 2.0
