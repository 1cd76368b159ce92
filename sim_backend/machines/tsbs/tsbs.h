/* Simulated TSBS rig: 6-DOF shaft on two radial AMBs, an axial AMB and a toothless self-bearing motor.
 * Units are SI. Bearing index 0 inboard, 1 outboard. Axis order xi, yi, xo, yo, z; coil order is axis by axis, p then n.
 * Between the marks is what Python reads as declarations: plain C, no preprocessor. */
#ifndef TSBS_H
#define TSBS_H
#include "core.h"

/* declarations begin */
typedef struct {
    /* shaft (T 6.6, Table 6.1); planes are signed distances from the centre of mass, outboard positive */
    double mass, inertia, polar_inertia, gravity, tilt, eccentricity, eccentricity_phase;
    double z_amb[2], z_sensor[2], z_motor, z_hook, z_lever;
    /* radial AMBs (T 2.4): force constant, gap, magnetic offset, runout harmonics 1..4 of the journal, hysteresis */
    double beta[2], asymmetry[2], gap[2], offset_x[2], offset_y[2], runout[8], runout_phase[8], hysteresis;
    double beta_z, gap_z;
    /* motor: T (6.5) for any gamma, with the ripple, the side pull and the displacement terms of T (5.25) */
    double alpha_d, alpha_c, alpha_x, alpha_tau, motor_x, motor_y, gamma_zero, segment_gain[4], pole_pairs;
    double alpha_2, alpha_3, alpha_4, alpha_6, beta_2, beta_4, exchange_segments;
    /* 12: each segment has an amplifier, which is told its amplitude; 6: segments 1, 2 and 3, 4 share one, which is told q and d
     * (T chapter 7). Of the latter the four words of segment currents are q1, d1, q2, d2. */
    double phases;
    /* of the controller: 1 for an equation of T chapter 7 as it is printed, of (7.14) 2 for the force alone */
    double literal_7_6b, literal_7_13, literal_7_14, literal_7_18;
    /* drag: drag_share of `viscous` (at 3 A) goes with the square of the AMBs' currents; brake: while no drive drives */
    double viscous, drag_share, coulomb, coulomb_speed, brake, detent, detent_phase;
    double lever_slip;
    /* touchdown rings at the sensor planes, strap of the hanger */
    double clearance, ring_stiffness, ring_damping, ring_friction, ring_radius, ring_x[2], ring_y[2];
    double strap_stiffness, strap_damping;
    /* amplifiers and current sensors, per coil and per segment */
    double amplifier_rate, segment_rate, segment_limit, coil_limit[10];
    double current_gain[10], current_offset[10], current_drift[10], current_noise, current_lsb;
    double segment_sense[4], segment_offset[4], segment_drift[4], segment_scale_drift;
    /* position sensors xi yi xo yo z; a stuck sensor reads stuck_value; runout of the sensor targets */
    double position_gain[5], position_offset[5], position_sign[5], position_noise, position_lsb;
    double stuck[5], stuck_value, target[8], target_phase[8], exchange_axes[2];
    double encoder_counts, encoder_offset, encoder_sign;
    /* trips */
    double lost_radius, lost_time, trip_current, trip_speed;
} tsbs_params;

typedef struct {
    double bias_i, bias_o, bias_z;
    double kp_i, kd_i, ki_i, kp_o, kd_o, ki_o, kp_z, kd_z, ki_z;
    double ref_xi, ref_yi, ref_xo, ref_yo, ref_z;
    double angle_ref, angle_slew, kp_theta, kd_theta, ki_theta, speed_ref;
    double i_x, i_y, gamma;
    double lift_time_s, current_limit;
    double torque_on, derivative_hz, angle_hz, i_ramp, acceleration;
    /* the motor instead of the outboard AMB; how the segments share force and torque (0: T 6.9, 1: T 6.19 with 6.24) */
    double motor_share, share_slew, kp_m, kd_m, ki_m, ref_xm, ref_ym, allocation, segment_max;
    double derivative_on_error, sine_amplitude, sine_hz;
    /* 1: commutation ahead by the speed times segment_lag s, the time by which the segment currents are late */
    double lag_compensation, segment_lag, pole_pairs;
    /* 1: the motor lifts its end by itself, the outboard AMB stays off; how fast gamma changes (0: at once); 1: torque at its
     * limit until speed_ref; a circle about the motor's set point */
    double lift_by, gamma_slew, torque_limit_run, circle_radius, circle_hz;
    /* 1: T (6.29) with gamma by (6.36), (6.37); what the controller knows of the motor, referred to the outboard sensors */
    double balance, gamma_max, kp_b, kd_b, observer_pole, model_alpha_d, model_alpha_c, model_stiffness, model_mass;
    /* as the machine has them */
    double phases, literal_7_6b, literal_7_13, literal_7_14, literal_7_18;
    /* the controller's own idea of the planes: plane = share * outboard reading + (1 - share) * inboard reading */
    double share_i, share_o;
} tsbs_control;

typedef struct {
    double integral[5], filtered[5], previous[5], rest[5];
    double angle_target, speed_target, angle_integral, angle_filtered, angle_previous, i_x, i_y;
    double goal_filtered, goal_previous, sine_phase, share, motor_integral[2], motor_filtered[2], motor_previous[2];
    double lift_clock, turns, up;
    double gamma, field_gamma, field_c, field_s, motor_rest[2], circle, circle_phase;
    double observed[6], acted[2], load[2], line, balancing; /* of each axis position, velocity, constant load */
    double told[6];                                         /* i_x, i_y, torque current asked for and given, its bound, lambda */
    int32_t mode, fresh;
} tsbs_law_state;

typedef struct {
    double position[5], angle;
} tsbs_reading;

typedef struct {
    double coil[10], segment[4], across[4], gamma, ahead; /* segments along and across the field, which gamma and `ahead` turn */
    double turn_c, turn_s;                                /* from there to the stator */
} tsbs_reference;

typedef struct {
    double s[14];           /* x y z phi psi theta and their rates; height and speed of the hung mass */
    double coil[10], segment[8], play[4], follow[4]; /* segments in the stator's frame: four real parts, four imaginary ones */
    double hung_mass, weight, weight_to, weight_rate;
    /* external drive: torque = gain * (speed - the shaft's), at most limit; speed goes to its target by the ramp; gain 0: off */
    double drive_gain, drive_limit, drive_ramp, drive_target, drive_speed;
    /* lever: weight on it, its moment about the shaft (left end down positive), how far it has slipped; what it and a
     * ring add to the polar inertia */
    double lever_weight, lever_weight_to, lever_weight_rate, lever_moment, lever_moment_to, lever_moment_rate, slip;
    double lever_inertia, ring_inertia;
    tsbs_reference applied, next;
    tsbs_law_state law;
    core_noise noise, across_noise; /* the second of what captures alone read */
    double speed, angle_before, sums[24];
    int64_t tick, trip_tick;
    int32_t trips, lost_ticks, flags, in_period, substeps, freed;
} tsbs_state;

void tsbs_start(const tsbs_params *, const tsbs_control *, tsbs_state *, uint64_t seed);
int64_t tsbs_run(const tsbs_params *, const tsbs_control *, tsbs_state *, int64_t ticks, double *rows, int64_t row_limit,
                 double *trace, int64_t every);
void tsbs_derivative(const tsbs_params *, const double *s, const double *coil, const double *segment,
                     const double *play, double gamma, double hung_mass, double weight, const double *lever, double *ds);
void tsbs_law(const tsbs_control *, tsbs_law_state *, const tsbs_reading *, tsbs_reference *);
double tsbs_amb_force(double beta, double gap, double xi, double coil_p, double coil_n);
/* declarations end */

enum { SEGMENT_SATURATED = 2 };
#define COLUMNS 22
#define TRACE 24

/* what does not change inside a run or a tick: harmonic coefficients a cos p and a sin p, sines, decays */
typedef struct {
    double runout_c[8], runout_s[8], target_c[8], target_s[8], tilt_c, tilt_s, motor_c, motor_s;
    double per_position_lsb, per_current_lsb, per_gain[10], per_sense[4], per_mass, per_inertia, per_coulomb_speed;
    double angle, turn_c, turn_s, detent_c, detent_s, unbalance_c, unbalance_s, coil_keep, segment_keep, segment_tick, speed_keep;
    int near; /* a ring may be touched within this tick */
    /* radial axes in the order xi, yi, xo, yo, so that one loop, and with it one vector, does all four: force constant,
     * gap, plane, magnetic offset, runout of the journal as cubics about `angle` */
    double axis_beta[4], axis_gap[4], axis_z[4], axis_offset[4], runout[4][4];
    double unbalance, gravity_x, gravity_y;
    /* of this tick: M times the angle, and by how much the field is turned; the drive, the drag, the lever, the inertia */
    double pole_pairs, pole_c, pole_s, field, field_c, field_s, sensed_c, sensed_s;
    double drive_gain, drive_limit, drive_speed, viscous, coulomb;
    double lever_weight, lever_c, lever_s, polar_inertia, per_polar;
} tsbs_derived;
/* the law's parameters by axis, and the shares that its filters keep: they hold over a run */
typedef struct {
    double kp[5], kd[5], ki[5], bias[5], set[5], keep, angle_keep;
} tsbs_gains;
void tsbs_settle(const tsbs_control *, tsbs_gains *);
void tsbs_act(const tsbs_control *, const tsbs_gains *, tsbs_law_state *, const tsbs_reading *, tsbs_reference *);
void tsbs_derive(const tsbs_params *, double step, tsbs_derived *);
void tsbs_commutate(const tsbs_params *, tsbs_derived *, tsbs_reference *);
void tsbs_hold(const tsbs_params *, const double *coil, const double *lever, tsbs_derived *);
void tsbs_at(tsbs_derived *, double angle, double *c, double *s);
double tsbs_harmonics(const double *c, const double *s, const double *turn_c, const double *turn_s, double *quadrature);
void tsbs_rates(const tsbs_params *, const tsbs_derived *, const double *s, const double *coil, const double *mixed,
                const double *play, double hung_mass, double weight, double *ds);
void tsbs_mix(const tsbs_params *, const double *segment, double *mixed);
void tsbs_sense(const tsbs_params *, tsbs_derived *, tsbs_state *, tsbs_reading *, double *coil, double *segment);
#endif
