"""Parameters of the AMB stand and of its control laws, SI. Defaults are the nominal `amb5dof` machine.

T is the thesis; what it does not print is a stand-in and says so. Names as in `amb5dof.h`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

Two = tuple[float, float]
Four = tuple[float, float, float, float]
Many = tuple[float, ...]
GRAVITY = 9.81
MASS_KG = 0.98
PLANE_ANGLE = math.pi / 3
"""Between the unbalances of the two planes (stand-in): static and dynamic unbalance together."""


def unbalance(eccentricity_m: float, mass_kg: float = MASS_KG) -> Two:
    """Unbalances in kg m of the two planes: mass times eccentricity in all, one half each, PLANE_ANGLE apart."""
    return mass_kg * eccentricity_m / 2, mass_kg * eccentricity_m / 2


def runout(inboard: Four, outboard: Four, inboard_phase: Four, outboard_phase: Four) -> dict[str, Many]:
    """Runout of the two journals, orders 1 to 4, as the sensors see it: z stands 90 deg after y in the sense of rotation."""
    both = ((inboard, inboard_phase), (outboard, outboard_phase))
    later = [tuple(p - (n + 1) * math.pi / 2 for n, p in enumerate(phase)) for _, phase in both]
    amplitudes = [a for values, _ in both for a in (*values, *values)]
    phases = [p for (_, phase), z in zip(both, later, strict=True) for p in (*phase, *z)]
    return {"runout": tuple(amplitudes), "runout_phase": tuple(phases)}


UNBALANCE = unbalance(10e-6)


@dataclass(frozen=True)
class AmbParams:
    """The machine. Axis order yi, zi, yo, zo, x; coils axis by axis, p then n; planes inboard, outboard.

    Left out: motional emf and the position's share of the inductance, eddy currents, hysteresis, the amplifiers' ripple, the
    gyroscopic split of the bending modes.
    """

    mass: float = MASS_KG  # T Table 2.3
    inertia: float = 5.84e-3  # T Table 2.3
    polar_inertia: float = 1.71e-4  # T Table 2.3
    gravity_y: float = -GRAVITY / math.sqrt(2)  # axes at 45 deg, positive coils the upper ones (T (2.6), corrected)
    gravity_z: float = -GRAVITY / math.sqrt(2)
    l_ia: float = 0.097  # T Table 2.3, as the other lengths
    l_oa: float = 0.081
    l_is: float = 0.078
    l_os: float = 0.100
    l_iu: float = 0.097  # stand-in: the journals are where weights can be fixed
    l_ou: float = 0.081
    l_c: float = 0.155  # T Table 2.3
    coupling: float = 1200.0  # T Table 2.3
    coupling_offset: Two = (0.0, 0.0)  # where it is relaxed, y and z: how far the motor is out of line
    beta: Many = (6.95e-7, 6.95e-7, 6.95e-7, 6.95e-7, 5e-6)  # T Table 2.2 (inboard, taken for all four) and 2.3
    gap: float = 5.25e-4  # T Table 2.3
    gap_x: float = 7.83e-4  # T Table 2.3
    offset: Four = (1.15e-4, 1.15e-4, 1.15e-4, 1.15e-4)  # T Table 2.2 with the sign that goes with gravity
    unbalance: Two = UNBALANCE  # stand-in: e of 10-20 um fits T Fig. 2.7
    unbalance_phase: Two = (0.5, 0.5 + PLANE_ANGLE)  # stand-in
    viscous: float = 8e-6  # stand-in: 41 s from 14 000 r/min to standstill
    coulomb: float = 2e-3  # stand-in
    coulomb_speed: float = 0.5  # stand-in
    clearance: float = 1e-4  # T 3.5: positioning limits of about 100 um
    ring_stiffness: float = 5e6  # stand-in
    ring_damping: float = 500.0  # stand-in
    ring_friction: float = 0.1  # stand-in
    ring_radius: float = 4.75e-3  # T 2.2: half the shaft's diameter
    stop: float = 2e-4  # stand-in
    mode_on: Two = (0.0, 0.0)
    mode_hz: Two = (650.0, 1240.0)  # T 2.6.1
    mode_damping: Two = (2e-3, 2e-3)  # stand-in: so little that the second mode needs its notch (T 2.6.1)
    mode_mass: Two = (0.245, 0.245)  # stand-in: a quarter of the mass, as a uniform free beam with ends at 1
    # stand-ins: a uniform free beam of 305 mm that begins at the coupling; mode by mode, inboard and outboard
    shape_amb: Four = (0.139, -0.008, -0.349, 0.509)
    shape_sensor: Four = (-0.108, 0.251, -0.591, 0.203)
    shape_unbalance: Four = (0.139, -0.008, -0.349, 0.509)
    shape_coupling: Two = (1.0, 1.0)
    amplifier_rate: float = 2 * math.pi * 400  # T 2.5: current loop of about 400 Hz
    inductance: float = 20e-3  # stand-in that T Fig. 2.9 needs; 2 beta/gap would be 2.65 mH
    resistance: float = 1.0  # stand-in
    u_max: float = 48.0  # T 2.5
    coil_limit: float = 3.0  # T 2.5
    current_gain: Many = (1.0,) * 10
    current_offset: Many = (0.0,) * 10
    current_noise: float = 2e-3  # stand-in
    current_lsb: float = 10.0 / 65536  # stand-in: 16 bits over +-5 A
    voltage_gain: Many = (1.0,) * 10
    voltage_offset: Many = (0.0,) * 10
    position_gain: Many = (1.0,) * 5
    position_offset: Many = (0.0,) * 5
    position_sign: Many = (1.0,) * 5
    position_noise: float = 3e-7  # stand-in: eddy-current probes of 0.1-0.4 um rms
    position_lsb: float = 5e-4 / 65536  # stand-in: 16 bits over +-250 um
    position_range: float = 2.5e-4  # stand-in
    runout: Many = (0.0,) * 16  # yi, zi, yo, zo, orders 1..4 each; see `runout`
    runout_phase: Many = (0.0,) * 16
    hum: Many = (0.0,) * 5  # of each probe's reading, in phase, amplitude 0-pk, m: mains or the like, no motion
    hum_hz: float = 0.0  # 0: none
    pulse_angle: float = 0.0
    pulse_missing: float = 0.0  # every how manieth pulse does not come; 0: none is missing
    pulse_doubled: float = 0.0  # how far after the mark there is a second one, rad; 0: there is none
    pulse_last: float = 0.0  # after so many pulses none comes any more; 0: they do not end
    exchange_planes: float = 0.0
    exchange_axes: float = 0.0  # probes of y and z, in both planes
    loose_speed: float = 0.0  # speed in rad/s above which mounted weights slip, once, by loose_shift; 0: never
    loose_shift: float = 0.0
    lost_radius: float = 1e-4  # stand-in: in the ring
    lost_time: float = 0.1  # stand-in: longer than a brush with the ring
    trip_current: float = 3.4  # stand-in
    trip_speed: float = 15500 * math.pi / 30  # stand-in: above the motor's 15 000 r/min (T 2.2)


@dataclass(frozen=True)
class AmbControl:
    """The laws' parameters; `law` 0 PID, 1 flatness with CCS, 2 flatness with CAC; `observer` 0 none, 1 with the disturbances
    inside, 2 T (3.6) with (3.13) as printed; `compensate` 1 the constant, 2 the synchronous disturbance, 3 both."""

    law: float = 0.0
    lift_time_s: float = 0.5
    current_limit: float = 3.0  # T 2.5
    bias: float = 1.0  # T Table 2.4, i_b
    kp: float = 8e3  # T Table 2.4, A/m
    ki: float = 1e4  # T Table 2.4, A/(m s): the printed units are exchanged
    kd: float = 13.0  # T Table 2.4, A s/m
    k0: float = 1e5  # T Table 2.4, 1/s^3
    k1: float = 1.5e5  # T Table 2.4, 1/s^2
    k2_ccs: float = 300.0  # T Table 2.4, 1/s
    k2_cac: float = 250.0  # T Table 2.4, 1/s
    eta: float = 0.1  # T Table 2.4, N
    integral: float = 1.0
    derivative_hz: float = 2000.0  # stand-in
    notch1_hz: float = 0.0
    notch1_q: float = 1.0
    notch2_hz: float = 0.0
    notch2_q: float = 1.0
    ref_x: float = 0.0
    ref_y: float = 0.0
    ref_z: float = 0.0
    ref_psi: float = 0.0
    ref_theta: float = 0.0
    slew: float = 1e-3
    slew_tilt: float = 1e-2
    ellipse_on: float = 0.0
    ellipse_y: float = 0.0
    ellipse_z: float = 0.0
    ellipse_hz: float = 10.0
    ellipse_phase: float = 0.0
    ellipse_ramp_s: float = 1.0  # T (3.16)
    ellipse_ratio: float = 1.0
    inject_axis: float = -1.0
    inject_amplitude: float = 0.0
    inject_hz: float = 100.0
    inject_lines: float = 1.0
    inject_step: float = 0.0
    observer: float = 0.0
    compensate: float = 0.0
    observer_constant: float = 55.0  # T 3.5, 1/s
    observer_damping: float = 0.24  # T 3.5: 250/1047, as a share of the speed
    observer_turning: float = 0.81  # T 3.5: 850/1047
    observer_velocity: float = 1500.0  # stand-in, rad/s: T's 3500 and 4500 do not fit a tick and the amplifiers
    observer_speed: float = 100.0  # stand-in, rad/s: below it the synchronous disturbance is left alone
    model_mass: float = MASS_KG
    model_inertia: float = 5.84e-3
    model_polar: float = 1.71e-4
    model_gravity_y: float = -GRAVITY / math.sqrt(2)
    model_gravity_z: float = -GRAVITY / math.sqrt(2)
    model_l_ia: float = 0.097
    model_l_oa: float = 0.081
    model_l_is: float = 0.078
    model_l_os: float = 0.100
    model_l_c: float = 0.155
    model_coupling: float = 1200.0
    model_beta_yi: float = 6.95e-7
    model_beta_zi: float = 6.95e-7
    model_beta_yo: float = 6.95e-7
    model_beta_zo: float = 6.95e-7
    model_beta_x: float = 5e-6
    model_gap: float = 5.25e-4
    model_gap_x: float = 7.83e-4
    model_offset_yi: float = 1.15e-4
    model_offset_zi: float = 1.15e-4
    model_offset_yo: float = 1.15e-4
    model_offset_zo: float = 1.15e-4
    model_rate: float = 2 * math.pi * 400
