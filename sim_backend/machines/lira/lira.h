/* The self-bearing linear-rotary actuator (L: the LDIA 2021 paper on the double-stator actuator; equation numbers are its own).
 * Two rotary actuators that give torque and radial force, one linear actuator between them; fifteen half-bridges with filters.
 * Units are SI. z along the shaft, x across, y up; plane 0 is the one at greater z. The angle counts from y to x: only so do (1),
 * (3) and (9) hold together (errata). Between the marks is what Python reads as declarations: plain C, no preprocessor. */
#ifndef LIRA_H
#define LIRA_H
#include "core.h"

/* declarations begin */
typedef struct {
    double force_constant, torque_constant[2], bearing_constant[2], pull[2]; /* N/A, N m/A, N/A, N/m; of each rotary actuator */
    double mass, polar_inertia, transverse_inertia, bearing_plane, sensor_plane, middle, pair_pitch;
    double cogging_force, cogging_torque, cogging_force_2, gravity;
    double coil_r[15], coil_l[15];                                      /* of coils */
    double filter_l[15], filter_c[15], damper_c[15], damper_r[15], filter_r; /* of half-bridges */
    double supply, emf;                                                 /* V; share of the emf that there is */
    double discharge_s; /* time constant of the DC link when nothing feeds it */
    double zero_ra[2], zero_la;                                         /* rad electrical: true phase is the encoder's less this */
    double centre[4], uneven[2], uneven_phase[2]; /* where the magnets pull from (x1, x2, y1, y2), and what turns with the mover */
    double runout, runout_phase, runout_per_m;    /* of the target */
    double eccentric[2];                          /* line of action of the linear actuator, x and y */
    double clearance, clearance_out, edge_in, edge_out, ring_stiffness, ring_damping, ring_friction, slip_speed, ring_radius;
    double stop_z, stop_stiffness, stop_damping;
    double push[6];               /* N at the planes (x1, x2, y1, y2), N along z, N m: planted or hung */
    double hung, hung_at, hung_N; /* kg on the mover, m from its centre of mass towards plane 0, and what it weighs */
    double part, part_at, part_N;  /* the same of a part that is put on and turns with it: a ring */
    double part_inertia, part_off, part_phase, part_grip; /* kg m^2 about its own middle, m that this is off the axis, rad; N m it bears */
    double position_gain[6], position_offset[6], position_noise[6], position_lsb[6], filter_lag; /* x1 x2 y1 y2 z angle; s */
    double bridge_gain[15], bridge_offset[15], bridge_noise, bridge_lsb;   /* readings of i_f */
    double coil_gain[15], coil_offset[15], coil_noise, coil_lsb;           /* of i_s */
    double voltage_gain[15], voltage_noise, voltage_lsb, ripple, late;     /* of u_s; V; s */
    double terminal[15], turned[15]; /* which coil a half-bridge drives; 1: the other way round */
    double strength[15]; /* share of its turns that this coil has, by half-bridge */
    double locked;                   /* the mover is clamped */
    double lag_rate, lag_damping;    /* of the current loops in the reduced model, rad/s and 1 */
} lira_params;

typedef struct {
    double kp_b, ki_b, kd_b, sat_b, kp_r, ki_r, kd_r, sat_r, kp_z, ki_z, kd_z, sat_z;
    double l11_b, l22_b, l11_r, l22_r, l11_z, l22_z;
    double observer, observer_pull, limit_after_ff, frozen_below; /* radial integrators rest below this z, m */
    double kp_s, ki_s, kp_sl, ki_sl, kp_v, ki_v, kp_i, current_max;
    double model_force, model_torque, model_bearing, model_mass, model_inertia, model_pull, model_cogging_force,
        model_cogging_torque, model_pitch, gravity;
    double psi_rot, psi_lin, zero_ra1, zero_ra2, zero_la, one_zero; /* Wb, rad electrical; 1: the first for both */
    double model_l_rot, model_l_lin, model_l_f, model_c;
    double inject_axis, inject_place, inject_amplitude, inject_hz;
    double hold_bound_m, hold_most_s, hold_mean_s, hold_share, hold_planes; /* bits: planes that a hold pushes */
    double gate_channels, gate_lag_s; /* bits: radial readings that the gate watches; low-pass before it, 0: none */
    double z_lift, v_lift, v_land, z_off, gate_m, gate_s, refuse_m, lost_m, lost_s, trip_A, supply_V, watchdog_s, rest_s; /* after the way down */
} lira_control;

typedef struct {
    double q[6], v[6], a[6];                  /* x y alpha beta z angle */
    double slip[3];                           /* of the part against the mover: rad, rad/s, rad/s^2 */
    double bridge[15], u[15], damper[15], coil[15]; /* i_f, u_s, u_d, i_s */
    double bridge_read[15], u_read[15], coil_read[15]; /* as the firmware has them */
    double sent[15], next[15];                /* u_sw now and from the next tick on */
    double stator[10], capacitor[10];         /* integrators; systems R1 B1 R2 B2 L, d and q */
    double wanted[10], manual[10];            /* dq references, and what is added to them */
    double coil_dq[10], u_dq[10], bridge_dq[10], u_ref[10], bridge_ref[10], sent_dq[10];
    double ref[6], ref_rate[6], read[6], was[6], sighted[4], filtered[4], run[2], seen[6], seen_rate[6], summed[6], force[6];
    double cos_ra[2], sin_ra[2], cos_la, sin_la; /* firmware's phases at the last reading of the position */
    double lag[20], contact, phase, wave, injected;
    double zero_c[3], zero_s[3], uneven_c[2], uneven_s[2]; /* of the encoders' zeros (two rotary, linear) and of what is uneven */
    double link;                             /* V of the DC link: fed while currents are on, else it discharges */
    double star[5][216];                     /* exact step: columns of twelve for twelve states, three u_sw, three emfs */
    int32_t member[5][3];                    /* half-bridges of each star */
    int32_t currents_on, bearings_on, angle_on, axial_on, fresh, limited;
    double gated[4]; /* radial readings as the gate has them */
    double mean[4], frozen[4]; /* slow means of the bearings' references B1 d, q, B2 d, q; what a hold keeps them at */
    int32_t held, hold_ended;  /* readings that a hold still has; why the last one ended: 0 its time, 1 a reading left the bound */
    double target[6], speed[6], rise[6]; /* where set points go, m or rad, and how fast at most */
    int32_t mode, fault, gate_clock, lost_clock, off_after; /* off_after: a landing ends without currents */
    int64_t heard; /* tick of the last heartbeat; -1: none is waited for */
    core_noise noise;
    int64_t tick;
} lira_state;

void lira_start(const lira_params *, lira_state *, uint64_t seed);
int32_t lira_command(const lira_params *, const lira_control *, lira_state *, int32_t command);
int32_t lira_hold(const lira_control *, lira_state *, int32_t across, double amperes, double seconds);
int64_t lira_run(const lira_params *, const lira_control *, lira_state *, int64_t ticks, double *trace, int64_t every, int32_t whole);
int64_t lira_run_reduced(const lira_params *, const lira_control *, lira_state *, int64_t ticks, double *trace, int64_t every,
                         int32_t whole);
void lira_coils(const double *dq, double cos_phase, double sin_phase, double *coils);
/* declarations end */

#define LIRA_TICK (1.0 / 280000)
#define POSITION_TICKS 8
#define BRIDGES 15
#define SYSTEMS 5
#define POLE_PAIRS 8
#define LIRA_TRACE 70
#define LIRA_WHOLE (LIRA_TRACE + 3 * BRIDGES + 3)
#define STEP_S (LIRA_TICK * POSITION_TICKS)
enum { LIRA_OFF, LIRA_IDLE, LIRA_CURRENT, LIRA_LIFT, LIRA_LEVITATED, LIRA_LANDING, LIRA_FAULT };
enum { DO_IDLE, DO_ON, DO_LIFT, DO_LAND, DO_STOP, DO_CLEAR, DO_SAFE };
enum { FAULT_NONE, FAULT_LOST, FAULT_CURRENT, FAULT_SUPPLY, FAULT_HOST };
enum { X1, X2, Y1, Y2, Z, ANGLE };

typedef struct {
    double c, s;
} lira_turn;

/* what the mover's place says: the turns by the true phases, where the planes stand and how fast they go */
typedef struct {
    lira_turn ra[2], la, angle;
    double lever[2], x[2], y[2], vx[2], vy[2];
} lira_place;

void lira_stars(const lira_params *, lira_state *);
void lira_step_stars(const lira_params *, lira_state *, const lira_place *);
void lira_locate(const lira_params *, const lira_state *, lira_place *);
void lira_rates(const lira_state *, lira_place *);
void lira_accelerate(const lira_params *, lira_state *, const lira_place *, const double *dq);
void lira_load(const lira_params *, lira_state *);
void lira_sight(const lira_params *, lira_state *, double step_s, double keep);
double lira_kept(const lira_params *, double step_s);
void lira_positions(const lira_params *, const lira_control *, lira_state *);
void lira_supervise(const lira_params *, const lira_control *, lira_state *);
void lira_hold_on(const lira_control *, lira_state *);
void lira_frozen(const lira_control *, lira_state *, double weight);
void lira_currents(const lira_params *, const lira_control *, lira_state *);
#endif
