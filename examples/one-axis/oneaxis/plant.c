/* The sampled loop: sense, law, one sample of delay, amplifiers and mechanics, means of a telemetry period, trips. */
#include <math.h>
#include <string.h>
#include "oneaxis.h"

#define STOP_N_M 1e7
#define STOP_NS_M 6e3

static double force(const oneaxis_params *p, const oneaxis_state *st) {
    double up = st->coil[0] / (p->gap - st->y), down = st->coil[1] / (p->gap + st->y);
    double into = fabs(st->y) - p->clearance, side = st->y > 0 ? 1 : -1;
    double stop = into > 0 ? side * STOP_N_M * into + STOP_NS_M * st->v : 0;
    return p->beta * (up * up - down * down) - p->mass * p->gravity - stop;
}

static void step(const oneaxis_params *p, oneaxis_state *st, const double *to, double h) {
    double keep = exp(-p->current_rate * h);
    for (int k = 0; k < 2; k++) st->coil[k] = to[k] + (st->coil[k] - to[k]) * keep;
    st->v += h * force(p, st) / p->mass;
    st->y += h * st->v;
}

static void watch(const oneaxis_params *p, oneaxis_state *st) {
    int trips = 0, lost = fabs(st->y) > p->lost_height;
    if (fabs(st->y) >= p->clearance) st->flags |= CONTACT;
    st->lost_ticks = st->law.mode == LEVITATE && lost ? st->lost_ticks + 1 : 0;
    if (st->lost_ticks * TICK > p->lost_time) trips |= TRIP_LOST;
    for (int k = 0; k < 2; k++) {
        if (st->coil[k] > p->trip_current) trips |= TRIP_CURRENT;
        if (st->next[k] >= p->current_limit) st->flags |= SATURATED;
    }
    if (trips & TRIP_LOST && !st->trips) st->law.mode = OFF;
    st->trips |= trips;
}

void oneaxis_start(const oneaxis_params *p, oneaxis_state *st, uint64_t seed) {
    int substeps = st->substeps;
    memset(st, 0, sizeof *st);
    st->substeps = substeps;
    st->y = -p->clearance;
    core_noise_seed(&st->noise, seed, 0);
}

/* Runs `ticks` control ticks, or fewer when a trip occurs (then to the end of the telemetry period). Each completed
 * period appends COLUMNS numbers to `rows`: means of position and currents, flags. Returns the number of ticks run. */
int64_t oneaxis_run(const oneaxis_params *p, const oneaxis_control *c, oneaxis_state *st, int64_t ticks, double *rows,
                    int64_t row_limit) {
    int64_t done = 0, filled = 0;
    int before = st->trips;
    while (done < ticks && (filled < row_limit || st->in_period)) {
        double normal[3], to[2], y;
        core_draws(&st->noise, normal, 3);
        y = p->position_gain * st->y + p->position_offset + p->position_noise * normal[0];
        memcpy(to, st->next, sizeof to); /* one sample of delay */
        oneaxis_law(c, &st->law, y, st->next);
        watch(p, st);
        st->sums[0] += y;
        for (int k = 0; k < 2; k++) {
            to[k] = st->law.mode == OFF ? 0 : fmin(to[k], p->current_limit);
            st->sums[1 + k] += p->current_gain[k] * st->coil[k] + p->current_offset[k] + p->current_noise * normal[1 + k];
        }
        for (int k = 0; k < st->substeps; k++) step(p, st, to, TICK / st->substeps);
        st->tick++;
        done++;
        if (++st->in_period < PERIOD) continue;
        double *row = rows + COLUMNS * filled++;
        for (int k = 0; k < 3; k++) row[k] = st->sums[k] / PERIOD;
        row[3] = st->flags;
        memset(st->sums, 0, sizeof st->sums);
        st->flags = st->in_period = 0;
        if (st->trips & ~before) break;
    }
    return done;
}
