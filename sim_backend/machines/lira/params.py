"""Parameters of the linear-rotary actuator's plant and of its firmware, by the names of the core's structs. L is the LDIA 2021
paper on the self-bearing double-stator linear-rotary actuator; what it does not print is a stand-in, and said to be one."""

from __future__ import annotations

import math
from dataclasses import dataclass

Pair = tuple[float, float]
Each = tuple[float, ...]
COILS = 15
"""Six coils of each rotary actuator, three of the linear one; as many half-bridges."""


@dataclass(frozen=True)
class PlantParams:
    """Electrical: 15 half-bridges with filter and damper, coils in five stars; mechanical: six degrees of freedom, SI.

    Numbers of each rotary actuator are pairs, of each half-bridge or coil fifteen; positions are x1, x2, y1, y2, z, angle.
    """

    force_constant: float = 83.5  # N/A, L table I K_L
    torque_constant: Pair = (0.21, 0.21)  # N m/A, K_R
    bearing_constant: Pair = (3.7, 3.7)  # N/A, K_B
    pull: Pair = (375e3, 375e3)  # N/m, K_pull
    mass: float = 1.34
    polar_inertia: float = 1.45e-3
    transverse_inertia: float = 2.91e-3  # stand-in: a tube of radius sqrt(J/m), 140 mm long
    bearing_plane: float = 0.045  # stand-in, from the middle
    sensor_plane: float = 0.045  # stand-in
    middle: float = 0.011  # stand-in, between L's two set points
    pair_pitch: float = 0.0125  # tau_pp, which acts as the pitch of a pair of poles
    cogging_force: float = 20.0  # N, of sin 2 theta
    cogging_torque: float = 0.0376  # N m, of sin 6 phi: 48 a turn
    cogging_force_2: float = 0.0  # N, of sin 4 theta
    gravity: float = 9.81
    coil_r: Each = (1.8,) * 12 + (6.3,) * 3
    coil_l: Each = (2.4e-3,) * 12 + (31e-3,) * 3
    filter_l: Each = (80e-6,) * COILS
    filter_c: Each = (4.8e-6,) * COILS
    damper_c: Each = (4.8e-6,) * COILS
    damper_r: Each = (6.8,) * COILS
    filter_r: float = 0.02  # stand-in
    supply: float = 400.0
    discharge_s: float = 2.0  # stand-in: bleeder; to 60 V in 3.8 s, IEC 60204-1 asks for 5 s
    emf: float = 1.0
    zero_ra: Pair = (0.0, 0.0)
    zero_la: float = 0.0
    centre: Each = (0.0,) * 4
    uneven: Pair = (0.0, 0.0)
    uneven_phase: Pair = (0.0, 0.0)
    runout: float = 0.0
    runout_phase: float = 0.0
    runout_per_m: float = 45.0  # rad of phase a metre along z, stand-in
    eccentric: Pair = (0.0, 0.0)
    clearance: float = 30e-6  # the touchdown rings: all stand-ins
    clearance_out: float = 250e-6
    edge_in: float = 2.8e-3
    edge_out: float = 4.5e-3
    ring_stiffness: float = 4e6
    ring_damping: float = 400.0
    ring_friction: float = 0.08
    slip_speed: float = 1e-3
    ring_radius: float = 0.033
    stop_z: float = -1e-3
    stop_stiffness: float = 1e6
    stop_damping: float = 800.0
    push: Each = (0.0,) * 6
    hung: float = 0.0  # kg
    hung_at: float = 0.0
    hung_N: float = 0.0
    part: float = 0.0  # kg, of what is put on and turns with the mover
    part_at: float = 0.0
    part_N: float = 0.0
    part_inertia: float = 0.0
    part_off: float = 0.0
    part_phase: float = 0.0
    part_grip: float = math.inf  # N m
    position_gain: Each = (1.0,) * 6
    position_offset: Each = (0.0,) * 6
    position_noise: Each = (0.3e-6,) * 4 + (1e-6, 30e-6)
    position_lsb: Each = (0.25e-6,) * 4 + (1e-6, 2 * math.pi / 2**16)
    filter_lag: float = 10e-6
    bridge_gain: Each = (1.0,) * COILS
    bridge_offset: Each = (0.0,) * COILS
    bridge_noise: float = 15e-3
    bridge_lsb: float = 24.4e-3
    coil_gain: Each = (1.0,) * COILS
    coil_offset: Each = (0.0,) * COILS
    coil_noise: float = 5e-3
    coil_lsb: float = 7.3e-3
    voltage_gain: Each = (1.0,) * COILS
    voltage_noise: float = 0.1
    voltage_lsb: float = 0.122
    ripple: float = 0.83  # V at 400 V, of the carrier in what u_s reads at its edges
    late: float = 0.0  # s
    terminal: Each = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0)
    turned: Each = (0.0,) * COILS
    strength: Each = (1.0,) * COILS
    locked: float = 0.0
    lag_rate: float = 2.1e4
    lag_damping: float = 0.9

    def ideal(self) -> dict[str, object]:
        """What to replace for sensors without noise, rounding, lag and ripple, for oracles."""
        bridges = ("bridge_noise", "bridge_lsb", "coil_noise", "coil_lsb", "voltage_noise", "voltage_lsb", "ripple")
        quiet: dict[str, object] = dict.fromkeys((*bridges, "filter_lag"), 0.0)
        return quiet | {"position_noise": (0.0,) * 6, "position_lsb": (0.0,) * 6}


@dataclass(frozen=True)
class ControlParams:
    """The firmware's parameters, L table II: position loops of the bearings (b), the angle (r) and z, observers, current loops,
    its model of the machine, what is injected.

    `inject_axis` -1: nothing; `inject_place` 0 reading, 1 reference and its rate, 2 force. `observer` 0: none, the difference.
    """

    kp_b: float = 680e3
    ki_b: float = 10.2e6
    kd_b: float = 2550.0
    sat_b: float = 26.2
    kp_r: float = 25.0
    ki_r: float = 99.0
    kd_r: float = 0.8
    sat_r: float = 0.839
    kp_z: float = 125e3
    ki_z: float = 5862e3
    kd_z: float = 1000.0
    sat_z: float = 166.0
    l11_b: float = 0.06
    l22_b: float = 0.04
    l11_r: float = 1.0
    l22_r: float = 0.005
    l11_z: float = 0.02
    l22_z: float = 0.09
    observer: float = 1.0
    observer_pull: float = 1.0
    limit_after_ff: float = 0.0
    frozen_below: float = -1.0  # m; never: integrators that rest in the rings leave a mover with uneven magnets on them
    kp_s: float = 40.0
    ki_s: float = 20e3
    kp_sl: float = 516.7  # the linear winding's, scaled by its inductance: at 40 V/A its loop has 205 Hz
    ki_sl: float = 105e3
    kp_v: float = 0.405  # A/V, as the dimension wants
    ki_v: float = 3553.0  # A/(V s)
    kp_i: float = 10.23
    current_max: float = 20.0  # stand-in
    model_force: float = 83.5
    model_torque: float = 0.21
    model_bearing: float = 3.7
    model_mass: float = 1.34
    model_inertia: float = 1.45e-3
    model_pull: float = 375e3
    model_cogging_force: float = 20.0
    model_cogging_torque: float = 0.0376
    model_pitch: float = 0.0125
    gravity: float = 9.81
    psi_rot: float = 20.7e-3
    psi_lin: float = 0.110
    zero_ra1: float = 0.0
    zero_ra2: float = 0.0
    zero_la: float = 0.0
    one_zero: float = 0.0  # 1: planted, the first for both rotary actuators
    model_l_rot: float = 2.4e-3
    model_l_lin: float = 31e-3
    model_l_f: float = 80e-6
    model_c: float = 9.6e-6
    inject_axis: float = -1.0
    inject_place: float = 1.0
    inject_amplitude: float = 0.0
    inject_hz: float = 100.0
    hold_bound_m: float = 20e-6  # stand-in: a reading beyond it ends a hold
    hold_most_s: float = 6e-3
    hold_mean_s: float = 0.1  # stand-in: time constant of the mean that a hold keeps
    hold_share: float = 0.75  # stand-in: of the bearings' limit that a catch may take
    hold_planes: float = 3.0  # bits: 1 the first plane, 2 the second one
    gate_channels: float = 15.0  # bits x1, x2, y1, y2: radial readings that the gate watches
    gate_lag_s: float = 0.0  # of a low-pass before it; none
    z_lift: float = 8e-3  # stand-in: where it is lifted to, out of the rings
    v_lift: float = 0.02
    v_land: float = 0.01  # L VI-B, as the next four
    z_off: float = 2.7e-3
    gate_m: float = 20e-6
    gate_s: float = 0.25
    refuse_m: float = 60e-6  # stand-in: at rest in the rings it reads 30 to 36 um, the bearings catch from 60
    lost_m: float = 100e-6
    lost_s: float = 1e-3
    trip_A: float = 12.0
    supply_V: float = 400.0
    watchdog_s: float = 0.08
    rest_s: float = 0.2  # stand-in: at z = 0 before the PWM goes off
