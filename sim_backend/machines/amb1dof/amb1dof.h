/* One axis of an AMB with a velocity estimator (T chapter 4). Units are SI; T is the thesis, n a count of samples.
 * Between the marks is what Python reads as declarations: plain C, no preprocessor. */
#ifndef AMB1DOF_H
#define AMB1DOF_H
#include "core.h"

/* declarations begin */
typedef struct {
    double mass, beta, gap, clearance, load, harmonic, harmonic_rate, harmonic_phase; /* rad/s, rad */
    double amplifier_rate, delay;                                                     /* rad/s; samples: 0 or 1 */
    double position_gain, position_offset, position_noise, current_gain[2], current_offset[2], current_noise;
    double trip_current, lost_position, lost_time;
    /* of the firmware: the sign factor of (4.15) left out; + for - in (4.11); its clock's share of the tick; the filters of (4.17)
     * exchanged; algebraic estimates told a sample late */
    double literal_weights, literal_sign, sample_factor, swapped, late;
} amb1_params;

typedef struct {
    double estimator, watched, degree, window_s, single_window_s, single_reset_s, rule, filter_hz;
    double bias, kp, kv, ref, compensate, harmonic_hz, pole_slow, pole_fast, pole_full, exact_rotation;
    double model_mass, model_beta, model_gap, inject_axis, inject_amplitude, inject_hz, inject_lines, inject_step;
    double lift_time_s, current_limit;
} amb1_control;

/* FIR weights of the exact rule: row n - first (n samples after the reset), newest sample last, rows of last + 1 */
typedef struct {
    const double *weights;
    int64_t first, last;
} amb1_table;

typedef struct {
    double eta[9], first;
    int64_t elapsed;
} amb1_filter;

typedef struct {
    amb1_filter filter[3]; /* two that overlap, one alone */
    double past[1024], filtered, previous, held, estimate[4], before[4]; /* velocity by each estimator, now and a sample ago */
    double reduced[3], full[5], load[2], harmonic[2];         /* observers; what the reduced and the full one tell */
    core_tones tones;
    double rest, lift_clock, injected, control;
    int64_t clock;
    int32_t mode, fresh, warm, was_free, degree;
    double weight[9]; /* a_1p of that degree */
} amb1_law_state;

typedef struct {
    double y, v, coil[2], next[2], applied[2], sums[7];
    double load_from, load_to, load_clock, load_time;
    amb1_law_state law;
    core_noise noise;
    int64_t tick;
    int32_t trips, lost_ticks, flags, in_period;
} amb1_state;

void amb1_start(const amb1_params *, amb1_state *, uint64_t seed);
int64_t amb1_run(const amb1_params *, const amb1_control *, const amb1_table *, amb1_state *, int64_t ticks, double *rows,
                 int64_t row_limit, double *trace, int64_t every);
double amb1_ccs(double force, double beta, double gap, double y, double bias);
void amb1_gains(const amb1_control *, double *reduced, double *full);
void amb1_watch(const amb1_params *, const amb1_control *, const amb1_table *, const double *y, int64_t count, double *v);
/* declarations end */

enum { DIFFERENCE, SINGLE, OVERLAPPING, FULL };
enum { EULER, FIRST_OFF, EXACT };
enum { TOUCH = 4 };
#define AMB1_COLUMNS 8
#define AMB1_TRACE 8
#define PAST 1024

double amb1_force(double beta, double gap, double y, double positive, double negative);
void amb1_estimate(const amb1_params *, const amb1_control *, const amb1_table *, amb1_law_state *, double y);
void amb1_law(const amb1_params *, const amb1_control *, const amb1_table *, amb1_law_state *, double y, double *coil);
double amb1_told(const amb1_control *, const amb1_law_state *);
#endif
