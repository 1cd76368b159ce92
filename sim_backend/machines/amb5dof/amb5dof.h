/* Simulated 5-DOF AMB stand (T ch. 2-3): rigid shaft with two bending modes on two radial AMBs and one axial AMB.
 * Units are SI. x axial, y and z radial at 45 deg to the vertical, psi about y, theta about z; bearing 0 inboard, 1 outboard.
 * Axis order yi, zi, yo, zo, x; coil order is axis by axis, p then n. A station is a place on the shaft, outboard positive.
 * Between the marks is what Python reads as declarations: plain C, no preprocessor. */
#ifndef AMB5DOF_H
#define AMB5DOF_H
#include "core.h"

/* declarations begin */
typedef struct {
    /* shaft and planes (T Table 2.3): AMBs, sensors, balancing planes; coupling of stiffness K at -l_c, relaxed
     * where the shaft is at coupling_offset (y, z) there: its motor is not quite in line */
    double mass, inertia, polar_inertia, gravity_y, gravity_z, l_ia, l_oa, l_is, l_os, l_iu, l_ou, l_c, coupling;
    double coupling_offset[2];
    double beta[5], gap, gap_x, offset[4];
    double unbalance[2], unbalance_phase[2]; /* kg m and rad, by plane */
    double viscous, coulomb, coulomb_speed;
    /* touchdown rings at the sensor planes, axial stop */
    double clearance, ring_stiffness, ring_damping, ring_friction, ring_radius, stop;
    /* bending modes: on or off, and the shape at both AMBs, sensors and balancing planes (mode by mode), at the coupling */
    double mode_on[2], mode_hz[2], mode_damping[2], mode_mass[2];
    double shape_amb[4], shape_sensor[4], shape_unbalance[4], shape_coupling[2];
    /* amplifiers: current loop of first order with a voltage limit; current sensors; what they read of the voltages */
    double amplifier_rate, inductance, resistance, u_max, coil_limit;
    double current_gain[10], current_offset[10], current_noise, current_lsb, voltage_gain[10], voltage_offset[10];
    /* position sensors yi zi yo zo x; runout of orders 1..4 of each radial one */
    double position_gain[5], position_offset[5], position_sign[5], position_noise, position_lsb, position_range;
    double runout[16], runout_phase[16];
    double hum[5], hum_hz; /* what is not motion: a sine on each reading, at one frequency, all in phase */
    /* once-per-turn pulse, when the shaft's angle + pulse_angle is a whole turn; defects */
    double pulse_angle, pulse_missing, pulse_doubled, pulse_last, exchange_planes, exchange_axes, loose_speed, loose_shift;
    double lost_radius, lost_time, trip_current, trip_speed;
} amb_params;

typedef struct {
    double law, lift_time_s, current_limit, bias, kp, ki, kd, k0, k1, k2_ccs, k2_cac, eta, integral, derivative_hz;
    double notch1_hz, notch1_q, notch2_hz, notch2_q;
    /* references: set points of the coordinates (slew 0: at once), ellipse */
    double ref_x, ref_y, ref_z, ref_psi, ref_theta, slew, slew_tilt;
    double ellipse_on, ellipse_y, ellipse_z, ellipse_hz, ellipse_phase, ellipse_ramp_s, ellipse_ratio;
    /* injection into the current reference of one axis (-1: none): lines at hz, hz + step... */
    double inject_axis, inject_amplitude, inject_hz, inject_lines, inject_step;
    double observer, compensate, observer_constant, observer_damping, observer_turning, observer_velocity, observer_speed;
    /* the controller's own idea of the machine */
    double model_mass, model_inertia, model_polar, model_gravity_y, model_gravity_z;
    double model_l_ia, model_l_oa, model_l_is, model_l_os, model_l_c, model_coupling;
    double model_beta_yi, model_beta_zi, model_beta_yo, model_beta_zo, model_beta_x, model_gap, model_gap_x;
    double model_offset_yi, model_offset_zi, model_offset_yo, model_offset_zo, model_rate;
} amb_control;

typedef struct {
    double hz[2], q[2], c[6], past[16];
} amb_notch;

typedef struct {
    /* of y, z, psi, theta: free motion, its rate, constant disturbance, synchronous displacement and its quadrature */
    double x[4][5], input[4], gain[5], speed, turn_c, turn_s, lead_c, lead_s, made[5];
    int32_t started, turning;
} amb_observer;

typedef struct {
    double rest[5], set[5], share, phase, lift_clock, filtered[5], previous[5], pid[5], sum[5];
    double coil[10], sent[10], waiting[10]; /* modelled currents; references acting, and acting from the next tick on */
    amb_notch notch;
    core_tones tones;
    amb_observer observer;
    int32_t mode, fresh, law;
} amb_law_state;

typedef struct {
    double position[5], speed;
} amb_reading;

typedef struct {
    double coil[10], inject, before, after;
} amb_reference;

typedef struct {
    double r[5], v[5], a[5];
} amb_motion;

typedef struct {
    double s[20]; /* x y z psi theta phi, their rates; bending y1 z1 y2 z2, their rates */
    double coil[10], voltage[10], weight_c[2], weight_s[2];
    double drive_gain, drive_limit, drive_ramp, drive_target, drive_speed;
    amb_reference applied, next;
    amb_law_state law;
    core_tacho tacho;
    core_noise noise;
    double sums[16], peak[3];
    int64_t tick, trip_tick;
    int32_t trips, lost_ticks, free_ticks, flags, in_period, substeps, loose;
} amb_state;

void amb_start(const amb_params *, const amb_control *, amb_state *, uint64_t seed);
int64_t amb_run(const amb_params *, const amb_control *, amb_state *, int64_t ticks, double *rows, int64_t row_limit,
                double *trace, int64_t every);
void amb_derivative(const amb_params *, const double *s, const double *coil, double torque, double *ds);
void amb_law(const amb_control *, amb_law_state *, const amb_reading *, amb_reference *);
double amb_ccs(double force, double beta, double gap, double xi, double bias);
void amb_cac(double force, double beta, double gap, double xi, double eta, double *pair);
double amb_follow(const amb_params *, double current, double reference, double time);
void amb_observer_gains(const amb_control *, amb_observer *, double speed);
/* declarations end */

#include "rotor.h"

enum { VOLTAGE_LIMIT = 2, CONTACT_X = 16, CLIPPED = 32 };
enum { X, Y, Z, PSI, THETA };
enum { YI, ZI, YO, ZO, AXIAL };
#define AMB_COLUMNS 24
#define AMB_TRACE 32
#define PER_TICK 1e4

/* what does not change inside a run or a tick */
typedef struct {
    double amb[2], sensor[2], unbalanced[2], per_mass, per_inertia, per_polar, per_current_lsb, per_position_lsb, per_gain[10];
    double square[2], damp[2], torque, keep[3], runout_c[16], runout_s[16];
    turning turned;
    int32_t flexible, runs_out, near, steps[3];
} amb_derived;
void amb_derive(const amb_params *, int substeps, amb_derived *);
void amb_unbalance(const amb_params *, const amb_state *, amb_derived *);
void amb_rates(const amb_params *, const amb_derived *, const double *s, const double *coil, double *ds);
void amb_plane(const amb_derived *, const double *s, double station, const double *shape, double *y, double *z);
void amb_sense(const amb_params *, amb_derived *, amb_state *, amb_reading *, double *coil);
void amb_refer(const amb_control *, amb_law_state *, amb_motion *);
void amb_notched(const amb_control *, amb_notch *, double *radial);
void amb_coordinates(const amb_control *, const double *at, double x, double *q);
void amb_planes(const amb_control *, const double *q, double *at);
void amb_betas(const amb_control *, double *beta);
void amb_magnetic(const amb_control *, const double *q, double *xi);
void amb_forces(const amb_control *, const double *q, const double *coil, double *force);
void amb_observe(const amb_control *, amb_law_state *, const double *q, double speed, double *rate, double *against,
                 double *wave, double *ahead);
#endif
