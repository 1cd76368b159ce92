/* One axis: a body of which only the height matters, between an upper and a lower coil. Units are SI, y is up.
 * Between the marks is what Python reads as declarations: plain C, no preprocessor. */
#ifndef ONEAXIS_H
#define ONEAXIS_H
#include "core.h"

/* declarations begin */
typedef struct {
    double mass, gravity, beta, gap, clearance, current_rate, current_limit;
    double position_gain, position_offset, position_noise, current_gain[2], current_offset[2], current_noise;
    double trip_current, lost_height, lost_time;
} oneaxis_params;

typedef struct {
    double bias, kp, kd, ki, ref, lift_time_s, derivative_hz, current_limit;
} oneaxis_control;

typedef struct {
    double integral, filtered, previous, rest, lift_clock;
    int32_t mode, fresh;
} oneaxis_law_state;

typedef struct {
    double y, v, coil[2], next[2], sums[3];
    oneaxis_law_state law;
    core_noise noise;
    int64_t tick;
    int32_t trips, lost_ticks, flags, in_period, substeps;
} oneaxis_state;

void oneaxis_start(const oneaxis_params *, oneaxis_state *, uint64_t seed);
int64_t oneaxis_run(const oneaxis_params *, const oneaxis_control *, oneaxis_state *, int64_t ticks, double *rows,
                    int64_t row_limit);
/* declarations end */

enum { CONTACT = 4 };
#define COLUMNS 4

double oneaxis_clip(double x, double low, double high);
void oneaxis_law(const oneaxis_control *, oneaxis_law_state *, double y, double *coil);
#endif
