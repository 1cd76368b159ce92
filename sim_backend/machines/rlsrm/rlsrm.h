/* The rotary-linear switched reluctance motor (R: Pan, Meng, Cao, IET Electr. Power Appl. 8 (2014) 199; equation numbers are
 * its own, corrected as docs/explanation/rotary-linear.md says). Two 6/4 stators side by side around one mover that turns and
 * slides; stator 0 lies at -x and pulls towards -x, stator 1 towards +x. Phases are A, B, C of stator 0, then of stator 1; a
 * phase attracts only, its sign of current does not matter. Axes are x (m) and the angle (rad). Units are SI.
 * Between the marks is what Python reads as declarations: plain C, no preprocessor. */
#ifndef RLSRM_H
#define RLSRM_H
#include "core.h"

/* declarations begin */
/* psi = leakage i + G i / sqrt(1 + (i/saturation)^2), G = overlap (m) times an inductance per m that depends on the angle */
typedef struct {
    double slope, unaligned, c2, c3;  /* H/m aligned; share unaligned; harmonics of 8 and 12 times the angle */
    double length, overlap, fringe;   /* m: of a stack, of mover and stator at x = 0, of the stray field at its ends */
    double leakage, saturation;       /* H, A */
    double gain[6], zero[2], centre;  /* of phases; rad, of stators against the encoder's zero; m, magnetic centre likewise */
    double uneven, uneven_phase;      /* once per turn: share, rad */
} rlsrm_map;

typedef struct {
    rlsrm_map map;
    double mass, inertia, viscous[2], coulomb, coulomb_angle, bearing_radius, along_path, coulomb_sides;
    double brake[2], locked[2], push[2], tilt, gravity; /* N, N m; 1: clamped; what acts from outside, along the axes; rad */
    double lock_give[2];              /* m/N, rad/(N m): of what clamps */
    double cell_stiffness[2], cell_damping[2]; /* N/m, N m/rad of load cells that hold it; 0: none do. N s/m, N m s/rad */
    double cell_past[2], cell_rate[2];         /* m, rad by which they are wound past their place; m/s, rad/s */
    double hung[2], hung_rate[2], added[2]; /* N, N m that are let go at N/s, N m/s; kg, kg m^2 that hang */
    double stop, stop_stiffness, stop_damping;
    double resistance[6], ambient, copper, thermal_resistance, thermal_capacity; /* ohm at 20 deg; deg C; 1/K; K/W; J/K */
    double supply, share[6];                               /* V; share of it that an amplifier can give */
    double current_gain[6], current_offset[6], wired[6];   /* readings of the amplifiers; which winding each drives */
    double pitch[2], edge[2], truncate[2];                 /* m and rad a count; where edges lie, counts; 1: next lower count */
    double scale, once, once_phase;                        /* of the linear encoder; rad, rad: the rotary one's error */
    double mark[2];                                        /* counts from the zero: the encoders' marks, around once a turn */
    double substeps;
} rlsrm_params;

typedef struct {
    rlsrm_map map;
    double kp[2], ki[2], kd[2], cut[2], limit[2]; /* N/m.. and N m/rad..; Hz of the derivative's filter, 0: none; N, N m */
    double wait, hold_at_limit;                   /* integrators wait for moves (2: for waves, too); at limits */
    double speed[2], rise[2];                     /* of set points, 0: at once */
    double wave[2], amplitude[2], period[2], phase[2], offset[2]; /* 0 constant (offset), 1 sine, 2 square */
    double pitch[2];
    double rule, printed_index, priority, hysteresis; /* 0 any two, 1 one of each stator, 2 Table 2; 0 both, 1 x, 2 angle */
    double corrected, by_force, turned, clipped; /* Table 2: two cells; key is the force's sign; stator I at +x; q < 0 is 0 */
    double current_max, kp_i, ki_i, resistance, late; /* of the amplifiers: A, V/A, V/(A s), ohm fed forward; ticks */
    double home_current[2], home_s[2], home_rate, safe_holds; /* A, s of a step; m/s; 1: held after MAKE_SAFE */
    double trip_A, trip_m, trip_rate[2], trip_warm, watchdog_s; /* m of stroke; m/s, rad/s; degrees C */
    double test_phase, test_current;                           /* READY: this phase alone carries so much; beyond 5: none */
    double current_zero[6];                                    /* A: what its sensors read without a current */
} rlsrm_control;

typedef struct {
    double q[2], v[2];                    /* x, angle and their rates */
    double i[6], u[6], summed[6], wanted[6], next[6], manual[6]; /* A; V given over the last tick; integrators of amplifiers */
    double g[6], along[6], around[6];     /* G and its slopes where the mover is: H, H/m, H/rad */
    double force[2];                      /* N, N m of all phases */
    double warm[6], mean[6], square[6];   /* degrees C; of i and of its square over the last period */
    double running[6], running_square[6];
    int64_t count[2];
    double read[2], ref[2], ref_rate[2], error[2], slope[2], integral[2], asked[2], given[2];
    int32_t on, loop[2], fresh, pair[2], flags, pending;
    int64_t changes, tick, wave_start;
    int64_t base[2], home[2], mark_seen[2]; /* counts: at power on, of the marks; 1: a mark went by */
    double target[2], rate_read[2], standing;
    int32_t mode, fault, homed[2], stage, stage_clock, waves, letting_go;
    int64_t heard; /* tick of the last heartbeat; -1: none is waited for */
    double rate_slow[2], hanging[2], lock_at[2]; /* rates through the loops' filters; N, N m that hang; where it is clamped */
    int32_t lock_shut[2], pulse_phase;
    int64_t pulse_left; /* ticks of a pulse of the whole supply */
    double cell_at[2], cell_now[2];    /* where the load cells belong, and are */
    int32_t cell_stage, cell_side;     /* 0 at rest, 1 going past on that side, 2 coming back along, 3 around */
} rlsrm_state;

void rlsrm_start(const rlsrm_params *, rlsrm_state *);
int64_t rlsrm_run(const rlsrm_params *, const rlsrm_control *, rlsrm_state *, int64_t ticks, double *trace, int64_t every);
void rlsrm_serve(const rlsrm_params *, const rlsrm_control *, rlsrm_state *, int64_t ticks, double *rows, double *trace,
                 int64_t every, int64_t shift);
void rlsrm_fail(rlsrm_state *, int32_t fault);
void rlsrm_slopes(const rlsrm_map *, const double *q, double *g, double *along, double *around);
int32_t rlsrm_distribute(const rlsrm_control *, const double *q, const double *along, const double *around, const double *asked,
                         int32_t *pair, double *current, double *given);
int32_t rlsrm_command(const rlsrm_control *, rlsrm_state *, int32_t command);
void rlsrm_power_on(const rlsrm_params *, rlsrm_state *);
void rlsrm_rub_once(const rlsrm_params *, rlsrm_state *, double seconds, const double *force);
/* declarations end */

#define PHASES 6
#define RLSRM_TICK 50e-6
#define LOOP_TICKS 20
#define LOOP_S (RLSRM_TICK * LOOP_TICKS)
#define RLSRM_TRACE 38
#define RLSRM_ROW 22
#define RLSRM_READINGS 16
enum { X, ANGLE };
enum { LIMITED = 1, NO_PAIR = 2, HOMED = 64 };
enum { RLSRM_OFF, RLSRM_READY, RLSRM_HOMING, RLSRM_HOLDING, RLSRM_MOVING, RLSRM_STOPPING, RLSRM_FAULT };
enum { DO_READY, DO_HOME, DO_HOLD, DO_PLAY, DO_STOP, DO_SAFE, DO_OFF, DO_CLEAR, DO_LET_GO };
enum { FAULT_NONE, FAULT_CURRENT, FAULT_SPEED, FAULT_STROKE, FAULT_WARM, FAULT_HOST, FAULT_SENSOR };
enum { REFUSED = 1, NOT_HOMED = 2 };

/* a map made ready: of each phase the turn of four times its aligned angle, and Lam = base + swing h */
typedef struct {
    double c[PHASES], s[PHASES], base[PHASES], swing[PHASES], c2, c3, length, overlap, fringe_2, centre;
    double uneven, uneven_c, uneven_s;
} rlsrm_ready;

/* the mover over a time: what is left of a rate, what an impulse gives, and what friction can take of it */
typedef struct {
    double keep[2], gain[2], seconds;
} rlsrm_mover;

void rlsrm_make_ready(const rlsrm_map *, rlsrm_ready *);
void rlsrm_look(const rlsrm_ready *, const double *q, double *g, double *along, double *around);
void rlsrm_ready_mover(const rlsrm_params *, double seconds, rlsrm_mover *);
void rlsrm_kick(const rlsrm_params *, const rlsrm_mover *, rlsrm_state *, const double *force);
double rlsrm_stop(const rlsrm_params *, const rlsrm_state *);
void rlsrm_amplifiers(const rlsrm_params *, const rlsrm_control *, rlsrm_state *, double *u);
void rlsrm_currents(const rlsrm_params *, rlsrm_state *, const double *before, double *u, double seconds);
void rlsrm_forces(const rlsrm_params *, rlsrm_state *);
int64_t rlsrm_counted(const rlsrm_params *, const rlsrm_state *, int axis);
void rlsrm_supervise(const rlsrm_params *, const rlsrm_control *, rlsrm_state *);
void rlsrm_loops(const rlsrm_params *, const rlsrm_control *, const rlsrm_ready *, rlsrm_state *);
#endif
