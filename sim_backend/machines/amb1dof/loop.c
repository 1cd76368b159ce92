/* The sampled loop: sense, law, amplifiers (exact), mechanics (RK4, one step of a sample), means of a telemetry period, trips. */
#include <math.h>
#include <string.h>
#include "amb1dof.h"
#include "numbers.h"

#define STOP_N_M 1e6
#define STOP_NS_M 300
#define CUT 3 /* standard deviations at which a position's noise ends */

/* what hangs on it, N, at a time within its handing over */
static double hung(const amb1_state *st, double after) {
    double t = st->load_clock + after, share = st->load_time > 0 ? clip(t / st->load_time, 0, 1) : 1;
    return st->load_from + share * (st->load_to - st->load_from);
}

static double rate(const amb1_params *p, const amb1_state *st, double y, double v, const double *coil, double after) {
    double angle = p->harmonic_rate * (st->tick * TICK + after) + p->harmonic_phase;
    double into = fabs(y) - p->clearance, stop = into > 0 ? (y > 0 ? 1 : -1) * STOP_N_M * into + STOP_NS_M * v : 0;
    double force = amb1_force(p->beta, p->gap, y, coil[0], coil[1]) + p->load + hung(st, after) + p->harmonic * sin(angle);
    return (force - stop) / p->mass;
}

static void step(const amb1_params *p, amb1_state *st, const double *to) {
    double h = TICK, half = exp(-p->amplifier_rate * h / 2), mid[2], end[2], y = st->y, v = st->v;
    for (int k = 0; k < 2; k++) {
        double from = p->amplifier_rate > 0 ? st->coil[k] : to[k];
        st->coil[k] = from;
        mid[k] = to[k] + (from - to[k]) * half;
        end[k] = to[k] + (mid[k] - to[k]) * half;
    }
    double a1 = rate(p, st, y, v, st->coil, 0), v2 = v + h / 2 * a1;
    double a2 = rate(p, st, y + h / 2 * v, v2, mid, h / 2), v3 = v + h / 2 * a2;
    double a3 = rate(p, st, y + h / 2 * v2, v3, mid, h / 2), v4 = v + h * a3;
    double a4 = rate(p, st, y + h * v3, v4, end, h);
    st->y = y + h / 6 * (v + 2 * v2 + 2 * v3 + v4);
    st->v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    memcpy(st->coil, end, sizeof end);
    st->load_clock += h;
}

static void watch(const amb1_params *p, const amb1_control *c, amb1_state *st) {
    int trips = 0, lost = fabs(st->y) > p->lost_position;
    if (fabs(st->y) >= p->clearance) st->flags |= TOUCH;
    st->lost_ticks = st->law.mode == LEVITATE && lost ? st->lost_ticks + 1 : 0;
    if (st->lost_ticks * TICK > p->lost_time) trips |= TRIP_LOST;
    for (int k = 0; k < 2; k++) {
        if (st->coil[k] > p->trip_current) trips |= TRIP_CURRENT;
        if (st->law.mode >= LIFT && st->next[k] >= least(2 * c->bias, c->current_limit)) st->flags |= SATURATED;
    }
    if (trips & TRIP_LOST && !st->trips) st->law.mode = OFF;
    st->trips |= trips;
}

static void read_all(const amb1_params *p, const amb1_control *c, amb1_state *st, double y, const double *normal, double *r) {
    int full = c->estimator == FULL;
    r[0] = y;
    for (int k = 0; k < 2; k++)
        r[1 + k] = p->current_gain[k] * st->coil[k] + p->current_offset[k] + p->current_noise * normal[1 + k];
    r[3] = amb1_told(c, &st->law);
    r[4] = st->law.load[full];
    r[5] = st->law.harmonic[full];
    r[6] = st->law.injected;
}

void amb1_start(const amb1_params *p, amb1_state *st, uint64_t seed) {
    memset(st, 0, sizeof *st);
    st->y = p->load < 0 ? -p->clearance : p->clearance; /* where the load has pushed it */
    core_noise_seed(&st->noise, seed, 0);
}

/* Runs `ticks` control ticks, or fewer when a trip occurs (then to the end of the telemetry period). Each completed period
 * appends AMB1_COLUMNS numbers to `rows`; every `every`-th tick (0: none) appends AMB1_TRACE readings to `trace`, the true
 * velocity last. Returns the number of ticks run. */
int64_t amb1_run(const amb1_params *p, const amb1_control *c, const amb1_table *table, amb1_state *st, int64_t ticks,
                 double *rows, int64_t row_limit, double *trace, int64_t every) {
    int64_t done = 0, filled = 0, kept = 0;
    int before = st->trips;
    while (done < ticks && (filled < row_limit || st->in_period)) {
        double normal[3], to[2], r[7];
        core_draws(&st->noise, normal, 3);
        double noise = p->position_noise * clip(normal[0], -CUT, CUT);
        double y = p->position_gain * st->y + p->position_offset + noise;
        memcpy(to, st->next, sizeof to);
        amb1_law(p, c, table, &st->law, y, st->next);
        if (p->delay == 0) memcpy(to, st->next, sizeof to);
        watch(p, c, st);
        read_all(p, c, st, y, normal, r);
        for (int k = 0; k < 7; k++) st->sums[k] += r[k];
        if (every && st->tick % every == 0) {
            memcpy(trace + AMB1_TRACE * kept, r, sizeof r);
            trace[AMB1_TRACE * kept++ + 7] = st->v;
        }
        if (st->law.mode == OFF) to[0] = to[1] = 0;
        step(p, st, to);
        st->tick++;
        done++;
        if (++st->in_period < PERIOD) continue;
        double *row = rows + AMB1_COLUMNS * filled++;
        for (int k = 0; k < 7; k++) row[k] = st->sums[k] / PERIOD;
        row[7] = st->flags;
        memset(st->sums, 0, sizeof st->sums);
        st->flags = st->in_period = 0;
        if (st->trips & ~before) break;
    }
    return done;
}
