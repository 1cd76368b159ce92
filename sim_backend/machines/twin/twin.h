/* A rotor as a rig file describes it: rigid, on radial magnetic bearings of any place and direction and perhaps an axial one,
 * with up to two bending modes. Units are SI. x along the shaft, in the sense in which its speed counts; y is up (or where the
 * rig file says directions have their 0), z a quarter turn on, psi about y, theta about z. A station is a place on x from the
 * centre of mass. Axes: the radial ones, then the axial one; arrays of 16 begin with as many and are padded.
 * A column of a table of axes or probes is what one unit of a coordinate moves there: y, z, psi, theta, bending y1 z1 y2 z2.
 * Between the marks is what Python reads as declarations: plain C, no preprocessor. */
#ifndef TWIN_H
#define TWIN_H
#include "core.h"

/* declarations begin */
typedef struct {
    int32_t radial, axial, probes, rings, planes, bearings; /* how many; axial 0 or 1: without it x is held */
    double tick;
    int32_t period, substeps, readings; /* ticks of a telemetry period; integration steps of 100 us; 1: a sample is no mean */
    /* shaft; what may move: tilts, and of y and z the directions yy, yz, zz of a projector */
    double mass, inertia, polar_inertia, gravity[3], free_tilt, free_radial[3];
    /* axes; the axial one: 1 where it pulls to positive x with its positive coil, else -1 */
    double axis[128], beta[16], gap[16], offset[16], beta_x, gap_x, offset_x, sense_x;
    int32_t bearing[16], coils[16];
    /* unbalance of the planes, kg m and rad from the shaft's mark */
    double plane[4], unbalance[4], unbalance_phase[4], shape_plane[8];
    /* touchdown rings and axial stop */
    double ring[8], clearance[8], shape_ring[16], ring_stiffness, ring_damping, ring_friction, ring_radius, stop;
    double coupling, coupling_at, coupling_offset[2], shape_coupling[2];
    double viscous, coulomb, coulomb_speed;
    double mode_on[2], mode_hz[2], mode_damping[2], mode_mass[2];
    /* amplifiers: current loop of first order with a voltage limit; what they read of currents and voltages: positive coils of
     * the axes, then negative ones */
    double amplifier_rate, inductance[16], resistance, u_max, coil_limit;
    double current_gain[32], current_offset[32], current_noise, current_lsb, voltage_gain[32], voltage_offset[32];
    /* probes: columns of the radial coordinates, and of x; runout of orders 1..4: of cos and sin of n times the shaft's angle */
    double probe[128], probe_x[16], position_gain[16], position_offset[16], position_sign[16], position_noise[16];
    double position_lsb, position_range, runout_c[64], runout_s[64], hum[16], hum_hz;
    /* once-per-turn mark: a pulse when the shaft's angle + pulse_angle is a whole turn; defects */
    double pulse_angle, pulse_missing, pulse_doubled, pulse_last, loose_speed, loose_shift;
    double start_angle, lost_share, lost_time, trip_current, trip_speed;
    /* which of what a period and a tick give are told, by their place in `twin_told` */
    int32_t told, traced, tell[128], trace[128];
} twin_params;

typedef struct {
    /* from probes to axes, probe by probe; axes' displacements by the shaft's set points x y z psi theta */
    double map[256], steer[80];
    double kp[16], ki[16], kd[16], bias[16], hold[16]; /* hold: i_p^2 - i_n^2 that carries the weight at the centre, A^2 */
    double derivative_hz, lift_time_s, current_limit, notch[6]; /* b0 = b2, b1 = a1 and a2 of each notch filter; b0 0: none */
    double ref_axis[16], ref[5], slew, slew_tilt;
    double path_on, path_y, path_z, path_hz, path_phase, path_ramp_s, path_ratio;
    double inject_axis, inject_amplitude, inject_hz, inject_lines, inject_step;
} twin_control;

typedef struct {
    double rest[16], set_axis[16], set[5], share, phase, lift_clock, filtered[16], previous[16], sum[16], past[64];
    core_tones tones;
    int32_t mode, fresh;
} twin_law_state;

typedef struct {
    double coil[32], inject, before, after;
} twin_reference;

typedef struct {
    double s[20]; /* x y z psi theta phi, their rates; bending y1 z1 y2 z2, their rates */
    double coil[32], voltage[32], weight_c[4], weight_s[4];
    double load[9], load_rate[9]; /* of what hangs: forces on x y z, moments psi theta, bending; how fast they still change */
    int64_t load_ticks;
    double drive_gain, drive_limit, drive_ramp, drive_target, drive_speed;
    twin_reference applied, next;
    twin_law_state law;
    core_tacho tacho;
    core_noise noise;
    double sums[80], inject, before, after, peak[16];
    int64_t tick, trip_tick;
    int32_t trips, lost_ticks, free_ticks, flags, in_period, loose;
} twin_state;

void twin_start(const twin_params *, twin_state *, uint64_t seed);
int64_t twin_run(const twin_params *, const twin_control *, twin_state *, int64_t ticks, double *rows, int64_t row_limit,
                 double *trace, int64_t every);
void twin_derivative(const twin_params *, const double *s, const double *coil, const double *load, double torque, double *ds);
double twin_follow(const twin_params *, int32_t axis, double current, double reference, double time);
/* declarations end */

#include "rotor.h"

enum { CURRENT_LIMIT = 512, VOLTAGE_LIMITED = 1024, OUT_OF_RANGE = 2048, CONTACT_AXIAL = 256 }; /* below: a bit for each ring */
enum { X, Y, Z, PSI, THETA };
/* places in what can be told; see TOLD in plant.py */
enum { AT_POSITION = 0, AT_CURRENT = 16, AT_VOLTAGE = 48, AT_PEAK = 80, AT_ANGLE = 96, AT_SPEED, AT_PULSES, AT_EDGE, AT_AGE,
       AT_INJECT, AT_BEFORE, AT_AFTER, AT_CONTACT, AT_CONTACT_AXIAL = 112, AT_LIMITS, AT_NOTHING = 116, AT_END };

/* four numbers at once, on any processor */
typedef double v4 __attribute__((vector_size(32), aligned(8)));
typedef long long m4 __attribute__((vector_size(32), aligned(8)));

/* what does not change inside a run or a tick */
typedef struct {
    double per_mass, per_inertia, per_polar, per_tick, per_current_lsb, per_position_lsb, per_gain[32];
    double square[2], damp[2], torque, keep[3], pull[32];
    turning turned;
    int32_t axes, blocks, law_blocks, probe_blocks, flexible, runs_out, near, free_ticks, steps[3];
} twin_derived;
void twin_derive(const twin_params *, twin_derived *);
void twin_unbalance(const twin_params *, const twin_state *, twin_derived *);
void twin_rates(const twin_params *, const twin_derived *, const double *s, const double *coil, const double *load, double *ds);
void twin_plane(const twin_derived *, const double *s, double station, const double *shape, double *y, double *z);
void twin_sense(const twin_params *, twin_derived *, twin_state *, double *position, double *coil);
void twin_law(const twin_params *, const twin_derived *, const twin_control *, twin_law_state *, const double *position,
              twin_reference *);
void twin_refer(const twin_params *, const twin_control *, twin_law_state *, double *r, double *v);
void twin_forget(twin_state *);
void twin_collect(const twin_derived *, twin_state *, const double *position, const double *coil);
void twin_report(const twin_params *, const twin_derived *, twin_state *, double *row);
void twin_record(const twin_params *, const twin_state *, const double *position, const double *coil, double *row);
#endif
