/* The controller, once a millisecond: counts are read, set points go on, position loops ask for force and torque, which are
 * shared out. A loop: kp e + integral + kd d, d the difference of the error through a filter of first order. An integrator waits
 * while a set point is sent to its target, and takes nothing in that its limit or the distribution does not give. */
#include <math.h>
#include <string.h>
#include "rlsrm.h"
#include "numbers.h"

/* the encoders count where the edges are; the rotary one sits off its axis, the linear one's scale is off */
static double seen(const rlsrm_params *p, const rlsrm_state *st, int axis) {
    if (axis == X) return st->q[X] * (1 + p->scale);
    return st->q[ANGLE] + p->once * sin(st->q[ANGLE] - p->once_phase);
}

int64_t rlsrm_counted(const rlsrm_params *p, const rlsrm_state *st, int k) {
    return (int64_t)floor(seen(p, st, k) / p->pitch[k] + p->edge[k] + (p->truncate[k] != 0 ? 0 : 0.5));
}

static double kept_share(double hz) { return hz > 0 ? 1 - exp(-TWO_PI * hz * LOOP_S) : 1; }

static int64_t below(int64_t a, int64_t every) { return a / every - (a % every < 0); }

/* a mark that goes by between two readings is latched with its count; the rotary one comes once a turn */
static void mark(const rlsrm_params *p, rlsrm_state *st, int k, int64_t from, int64_t to) {
    int64_t at = (int64_t)p->mark[k] - st->base[k], low = from < to ? from : to, high = from < to ? to : from;
    if (k == ANGLE) {
        int64_t turn = (int64_t)floor(TWO_PI / p->pitch[k] + 0.5);
        at += turn * below(high - at, turn);
    }
    if (low == high || at <= low || at > high) return;
    st->home[k] = at;
    st->mark_seen[k] = 1;
}

static void read_counts(const rlsrm_params *p, const rlsrm_control *c, rlsrm_state *st) {
    for (int k = 0; k < 2; k++) {
        if (p->pitch[k] == 0) {
            st->read[k] = seen(p, st, k);
            continue;
        }
        int64_t count = rlsrm_counted(p, st, k) - st->base[k];
        if (st->mode == RLSRM_HOMING && !st->homed[k]) mark(p, st, k, st->count[k], count);
        st->rate_read[k] = (double)(count - st->count[k]) * c->pitch[k] / LOOP_S;
        st->rate_slow[k] += kept_share(c->cut[k]) * (st->rate_read[k] - st->rate_slow[k]);
        st->count[k] = count;
        st->read[k] = (double)(count - st->home[k]) * c->pitch[k];
    }
}

static double wave(const rlsrm_control *c, int k, double t) {
    double turn = c->wave[k] != 0 ? t / c->period[k] + c->phase[k] : 0;
    if (c->wave[k] == 1) return c->amplitude[k] * sin(TWO_PI * turn);
    if (c->wave[k] == 2) return turn - floor(turn) < 0.5 ? c->amplitude[k] : -c->amplitude[k];
    return 0;
}

static int in_sine(const rlsrm_control *c, const rlsrm_state *st, int k) { return st->waves && c->wave[k] == 1; }

/* to the target by a speed and an acceleration at most. Braking in steps of h from v covers v^2/2a + v h/2, so that
 * v = sqrt(2 a d + (a h/2)^2) - a h/2 still comes to rest there. */
static void refer(const rlsrm_control *c, rlsrm_state *st, int k, double target) {
    double away = target - st->ref[k], far = fabs(away), rise = c->rise[k] * LOOP_S;
    if (c->speed[k] <= 0 || far == 0) {
        st->ref[k] = target;
        st->ref_rate[k] = 0;
        return;
    }
    double may = least(sqrt(2 * c->rise[k] * far + 0.25 * rise * rise) - 0.5 * rise, c->speed[k]);
    double rate = clip(away < 0 ? -may : may, st->ref_rate[k] - rise, st->ref_rate[k] + rise);
    if (rate * away > 0 && (fabs(rate) * LOOP_S >= far || (far < rise * LOOP_S && fabs(rate) <= rise))) {
        st->ref[k] = target;
        st->ref_rate[k] = 0;
        return;
    }
    st->ref_rate[k] = rate;
    st->ref[k] += rate * LOOP_S;
}

/* a sine is given, not sent; its rate is what a stop brakes from */
static void give(rlsrm_state *st, int k, double place) {
    st->ref_rate[k] = (place - st->ref[k]) / LOOP_S;
    st->ref[k] = place;
}

/* what loop k wants; `grown` is its integral, should it take this reading in */
static double wanted(const rlsrm_control *c, rlsrm_state *st, int k, double *grown) {
    double error = st->ref[k] - st->read[k], change = st->fresh ? 0 : (error - st->error[k]) / LOOP_S;
    st->slope[k] += kept_share(c->cut[k]) * (change - st->slope[k]);
    st->error[k] = error;
    int sent = c->speed[k] > 0 && st->ref_rate[k] != 0 && !in_sine(c, st, k);
    int waits = (c->wait >= 1 && sent) || (c->wait == 2 && c->wave[k] == 1);
    *grown = st->integral[k] + (waits ? 0 : c->ki[k] * error * LOOP_S);
    return c->kp[k] * error + *grown + c->kd[k] * st->slope[k];
}

/* an integral grows while an axis gets what it asks for, or if that leads away from the limit */
static void integrate(const rlsrm_control *c, rlsrm_state *st, int k, double want, double grown) {
    static const double SMALL[2] = {1e-5, 1e-6};
    double lack = want - st->given[k];
    if (c->hold_at_limit == 0 || fabs(lack) < SMALL[k] + 1e-3 * fabs(want) || (grown - st->integral[k]) * lack < 0)
        st->integral[k] = grown;
}

void rlsrm_loops(const rlsrm_params *p, const rlsrm_control *c, const rlsrm_ready *map, rlsrm_state *st) {
    double g[PHASES], along[PHASES], around[PHASES], want[2] = {0}, grown[2] = {0};
    double t = (double)(st->tick - st->wave_start) * RLSRM_TICK;
    read_counts(p, c, st);
    rlsrm_supervise(p, c, st);
    for (int k = 0; k < 2; k++) {
        if (st->mode == RLSRM_OFF) refer(c, st, k, c->offset[k] + wave(c, k, t));
        else if (in_sine(c, st, k)) give(st, k, st->target[k] + wave(c, k, t));
        else refer(c, st, k, st->target[k] + (st->waves ? wave(c, k, t) : 0));
        if (st->loop[k]) want[k] = wanted(c, st, k, &grown[k]);
        st->asked[k] = clip(want[k], -c->limit[k], c->limit[k]);
    }
    st->fresh = 0;
    if (!st->loop[X] && !st->loop[ANGLE]) {
        memcpy(st->next, st->manual, sizeof st->next);
        st->flags = 0;
    } else {
        int32_t former[2] = {st->pair[0], st->pair[1]};
        rlsrm_look(map, st->read, g, along, around);
        st->flags = rlsrm_distribute(c, st->read, along, around, st->asked, st->pair, st->next, st->given);
        st->changes += former[0] != st->pair[0] || former[1] != st->pair[1];
    }
    st->pending = (int32_t)c->late;
    for (int k = 0; k < 2; k++)
        if (st->loop[k]) integrate(c, st, k, want[k], grown[k]);
}
