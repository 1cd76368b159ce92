"""Parameters of the plant and of the control law, SI. Defaults are the nominal `tsbs12` machine, blemishes included."""

from __future__ import annotations

import math
from dataclasses import dataclass

Two = tuple[float, float]
Four = tuple[float, float, float, float]
Five = tuple[float, ...]
BIAS_A = 3.0
GAP_M = 5e-4


def beta_of(slope: float, gap: float = GAP_M, bias: float = BIAS_A) -> float:
    """Force constant N m^2/A^2 of a bearing from its slope N/A at the magnetic centre: 4 beta b / gap^2 (T 2.4)."""
    return slope * gap**2 / (4 * bias)


@dataclass(frozen=True)
class PlantParams:
    """The machine. Names as in `tsbs.h`; sources: T Tables 6.1 and 6.2, (6.12); the rest are stand-ins."""

    mass: float = 10.2
    inertia: float = 0.116
    polar_inertia: float = 0.033
    gravity: float = 9.8116
    tilt: float = 2e-3
    eccentricity: float = 2e-6
    eccentricity_phase: float = 0.7
    z_amb: Two = (-0.115, 0.010)
    z_sensor: Two = (-0.161, 0.052)
    z_motor: float = 0.122
    z_hook: float = 0.160
    z_lever: float = 0.160
    beta: Two = (beta_of(73.2), beta_of(74.4))
    asymmetry: Two = (0.0, 0.0)
    gap: Two = (GAP_M, GAP_M)
    offset_x: Two = (15e-6, -10e-6)
    offset_y: Two = (20e-6, -25e-6)
    runout: Five = (26e-6, 3e-6, 1e-6, 0.4e-6, 26e-6, 3e-6, 1e-6, 0.4e-6)
    runout_phase: Five = (0.3, 1.0, 2.0, 3.0, 1.4, 0.2, 0.9, 2.2)
    hysteresis: float = 1e-3
    beta_z: float = 1.5e-6
    gap_z: float = GAP_M
    alpha_d: float = 12.1
    alpha_c: float = 14.3
    alpha_x: float = 322.3e3 * 0.213 / 0.283
    alpha_tau: float = 2.87
    motor_x: float = 5e-6
    motor_y: float = -8e-6
    gamma_zero: float = 0.0
    segment_gain: Four = (1.0, 1.0, 1.0, 1.0)
    pole_pairs: float = 8.0
    alpha_2: float = 0.0
    alpha_3: float = 0.0
    alpha_4: float = 880.0
    alpha_6: float = 0.04
    beta_2: float = 116.0
    beta_4: float = 0.0
    exchange_segments: float = 0.0
    phases: float = 12.0
    literal_7_6b: float = 0.0
    literal_7_13: float = 0.0
    literal_7_14: float = 0.0
    literal_7_18: float = 0.0
    viscous: float = 0.081
    drag_share: float = 0.6
    coulomb: float = 0.05
    coulomb_speed: float = 0.05
    brake: float = 0.0
    detent: float = 0.01
    detent_phase: float = 0.4
    lever_slip: float = 0.0
    clearance: float = 2.5e-4
    ring_stiffness: float = 5e7
    ring_damping: float = 5e3
    ring_friction: float = 0.1
    ring_radius: float = 0.038
    ring_x: Two = (0.0, 0.0)
    ring_y: Two = (0.0, 0.0)
    strap_stiffness: float = 1e5
    strap_damping: float = 110.0
    amplifier_rate: float = 2 * math.pi * 1000
    segment_rate: float = 2 * math.pi * 2000
    segment_limit: float = 10.0
    coil_limit: Five = (12.0,) * 10
    current_gain: Five = (1.0,) * 10
    current_offset: Five = (0.0,) * 10
    current_drift: Five = (0.0,) * 10
    current_noise: float = 5e-3
    current_lsb: float = 30.0 / 65536
    segment_sense: Four = (1.0, 1.0, 1.0, 1.0)
    segment_offset: Four = (0.0, 0.0, 0.0, 0.0)
    segment_drift: Four = (0.0, 0.0, 0.0, 0.0)
    segment_scale_drift: float = 0.0
    position_gain: Five = (1.0,) * 5
    position_offset: Five = (0.0,) * 5
    position_sign: Five = (1.0,) * 5
    position_noise: float = 1.5e-7
    position_lsb: float = 1e-3 / 65536
    stuck: Five = (0.0,) * 5
    stuck_value: float = 0.0
    target: Five = (3e-6, 1e-6, 0.0, 0.0, 3e-6, 1e-6, 0.0, 0.0)
    target_phase: Five = (0.0, 0.5, 0.0, 0.0, 2.0, 1.5, 0.0, 0.0)
    exchange_axes: Two = (0.0, 0.0)
    encoder_counts: float = 4096.0
    encoder_offset: float = 0.0
    encoder_sign: float = 1.0
    lost_radius: float = 2.3e-4
    lost_time: float = 5e-3
    trip_current: float = 13.5
    trip_speed: float = 80.0


@dataclass(frozen=True)
class ControlParams:
    """The law's parameters. Gains: the unstable pole of the outboard end is sqrt(k/m'), k = K b/gap (0.45 MN/m) plus
    the motor's 0.24 MN/m by its leverage (0.237/0.125)^2, together 1.3 MN/m, on m' = (J + m 0.115^2)/0.125^2 = 16 kg:
    286 rad/s. K kp = 3.2 MN/m closes at twice to three times that, below the 1 kHz amplifiers and the one-sample delay.
    In the linear model without load the rigid modes have zeta 0.48, and 0.34 at worst with beta and alpha_x off by 25 %.
    The motor's PID (kp_m, kd_m, ki_m) has T's kp; kd and ki are larger, see docs/explanation/simulator.md.
    """

    bias_i: float = 3.0
    bias_o: float = 3.0
    bias_z: float = 2.0
    kp_i: float = 42e3
    kd_i: float = 42.0
    ki_i: float = 1e6
    kp_o: float = 43e3
    kd_o: float = 175.0
    ki_o: float = 6.8e5
    kp_z: float = 20e3
    kd_z: float = 60.0
    ki_z: float = 4e5
    ref_xi: float = 0.0
    ref_yi: float = 0.0
    ref_xo: float = 0.0
    ref_yo: float = 0.0
    ref_z: float = 0.0
    angle_ref: float = 0.0
    angle_slew: float = 2.0
    kp_theta: float = 50.0
    kd_theta: float = 1.0
    ki_theta: float = 100.0
    speed_ref: float = 0.0
    i_x: float = 0.0
    i_y: float = 0.0
    gamma: float = 0.0
    lift_time_s: float = 1.0
    current_limit: float = 12.0
    torque_on: float = 1.0
    derivative_hz: float = 1500.0
    angle_hz: float = 60.0
    i_ramp: float = 2.0
    acceleration: float = 20.0
    motor_share: float = 0.0
    share_slew: float = 2.0
    kp_m: float = 1e5
    kd_m: float = 300.0
    ki_m: float = 1e6
    ref_xm: float = 0.0
    ref_ym: float = 0.0
    allocation: float = 0.0
    segment_max: float = 10.0
    derivative_on_error: float = 0.0
    sine_amplitude: float = 0.0
    sine_hz: float = 0.0
    lag_compensation: float = 0.0
    segment_lag: float = 1.5e-4 + 1 / (2 * math.pi * 2000)
    pole_pairs: float = 8.0
    phases: float = 12.0
    literal_7_6b: float = 0.0
    literal_7_13: float = 0.0
    literal_7_14: float = 0.0
    literal_7_18: float = 0.0
    lift_by: float = 0.0
    gamma_slew: float = 0.0
    torque_limit_run: float = 0.0
    circle_radius: float = 0.0
    circle_hz: float = 0.0
    balance: float = 0.0
    gamma_max: float = math.radians(8)
    kp_b: float = 9e4
    kd_b: float = 420.0
    observer_pole: float = 1200.0
    model_alpha_d: float = 12.1
    model_alpha_c: float = 14.3
    model_stiffness: float = 344.3e3
    model_mass: float = 6.34
    share_i: float = (0.161 - 0.115) / 0.213
    share_o: float = (0.161 + 0.010) / 0.213
