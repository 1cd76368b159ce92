/* Time: one tick of the whole machine, or of the reduced one, in which every dq current follows its reference by a lag of second
 * order and all goes at 35 kHz. Mechanics by kick, drift, kick with one evaluation of the forces a step. */
#include <math.h>
#include <string.h>
#include "winding.h"

void lira_start(const lira_params *p, lira_state *st, uint64_t seed) {
    memset(st, 0, sizeof *st);
    core_noise_seed(&st->noise, seed, 1);
    for (int k = 0; k < 3; k++) {
        double zero = k < 2 ? p->zero_ra[k] : p->zero_la;
        st->zero_c[k] = cos(zero);
        st->zero_s[k] = sin(zero);
    }
    for (int a = 0; a < 2; a++) {
        st->uneven_c[a] = cos(p->uneven_phase[a]);
        st->uneven_s[a] = sin(p->uneven_phase[a]);
    }
    for (int a = 0; a < 2; a++) st->cos_ra[a] = 1;
    st->cos_la = 1;
    st->fresh = 1;
    st->mode = LIRA_OFF;
    st->heard = -1;
    st->link = p->supply;
    lira_stars(p, st);
}

void lira_coils(const double *dq, double cos_phase, double sin_phase, double *coils) {
    join(dq, (lira_turn){cos_phase, sin_phase}, coils);
}

/* dq currents in the true frames, coil by coil as they are wired */
static void true_currents(const lira_params *p, const lira_state *st, const lira_place *at, double *dq) {
    double coil[BRIDGES];
    for (int k = 0; k < BRIDGES; k++) coil[(int)p->terminal[k]] = p->strength[k] * (p->turned[k] != 0 ? -st->coil[k] : st->coil[k]);
    split_all(coil, at->ra, at->la, dq);
}

/* a part that slips is caught where its slip turns round */
static INLINE void kick(lira_state *st, double s) {
    for (int k = 0; k < 6; k++) st->v[k] += s * st->a[k];
    double was = st->slip[1];
    st->slip[1] += s * st->slip[2];
    if (was * st->slip[1] < 0) st->slip[1] = 0;
}

static INLINE void drift(lira_state *st, double s) {
    for (int k = 0; k < 6; k++) st->q[k] += s * st->v[k];
    st->slip[0] += s * st->slip[1];
}

/* dq currents, voltages, inductor currents as the firmware has them, readings, true places of the sensors, what acts */
static void tell(const lira_params *p, const lira_state *st, double *out) {
    memcpy(out, st->read, 6 * sizeof *out);
    for (int a = 0; a < 2; a++) {
        double s = (a ? -1 : 1) * p->sensor_plane - (st->q[Z] - p->middle);
        out[6 + a] = st->q[0] + st->q[3] * s;
        out[8 + a] = st->q[1] - st->q[2] * s;
    }
    out[10] = st->q[Z];
    out[11] = st->q[ANGLE];
    memcpy(out + 12, st->coil_dq, 10 * sizeof *out);
    memcpy(out + 22, st->u_dq, 10 * sizeof *out);
    memcpy(out + 32, st->bridge_dq, 10 * sizeof *out);
    memcpy(out + 42, st->wanted, 10 * sizeof *out);
    memcpy(out + 52, st->force, 6 * sizeof *out);
    memcpy(out + 58, st->seen_rate, 6 * sizeof *out);
    out[64] = st->contact;
    out[65] = st->limited;
    out[66] = st->injected;
    out[67] = st->mode;
    out[68] = st->fault;
    out[69] = st->wave;
}

/* a row of the trace, with the half-bridges' measurements and the age of the host's heartbeat where they are wanted too; how long
 * it is */
static INLINE int64_t tell_row(const lira_params *p, const lira_state *st, double *out, int32_t whole) {
    tell(p, st, out);
    if (!whole) return LIRA_TRACE;
    memcpy(out + LIRA_TRACE, st->bridge_read, sizeof st->bridge_read);
    memcpy(out + LIRA_TRACE + BRIDGES, st->u_read, sizeof st->u_read);
    memcpy(out + LIRA_TRACE + 2 * BRIDGES, st->coil_read, sizeof st->coil_read);
    out[LIRA_TRACE + 3 * BRIDGES] = st->link;
    out[LIRA_TRACE + 3 * BRIDGES + 1] = st->heard >= 0 ? (double)(st->tick - st->heard) * LIRA_TICK : -1;
    out[LIRA_TRACE + 3 * BRIDGES + 2] = st->held > 0;
    return LIRA_WHOLE;
}

/* forces where the mover is, once for the kick that ends a tick and the one that begins the next */
static void push(const lira_params *p, lira_state *st, lira_place *at) {
    double dq[10];
    lira_locate(p, st, at);
    true_currents(p, st, at, dq);
    lira_accelerate(p, st, at, dq);
}

int64_t lira_run(const lira_params *p, const lira_control *c, lira_state *st, int64_t ticks, double *trace, int64_t every,
                 int32_t whole) {
    int64_t rows = 0;
    double keep = lira_kept(p, LIRA_TICK);
    lira_place at;
    push(p, st, &at);
    for (int64_t n = 0; n < ticks; n++) {
        lira_sight(p, st, LIRA_TICK, keep);
        if (st->tick % POSITION_TICKS == 0) lira_positions(p, c, st);
        lira_currents(p, c, st);
        if (every && st->tick % every == 0) {
            trace += tell_row(p, st, trace, whole);
            rows++;
        }
        if (!p->locked) {
            kick(st, LIRA_TICK / 2);
            lira_rates(st, &at);
        }
        lira_step_stars(p, st, &at);
        if (!p->locked) {
            drift(st, LIRA_TICK);
            push(p, st, &at);
            kick(st, LIRA_TICK / 2);
        }
        memcpy(st->sent, st->next, sizeof st->sent);
        st->tick++;
    }
    return rows;
}

/* exact step of x'' = w^2 (u - x) - 2 z w x' over t, for z < 1: x and x' of x, x', u */
static void lag_step(double w, double z, double t, double *m) {
    double damped = w * sqrt(1 - z * z), decay = exp(-z * w * t), c = decay * cos(damped * t), s = decay * sin(damped * t) / damped;
    m[0] = c + z * w * s;
    m[1] = s;
    m[2] = -w * w * s;
    m[3] = c - z * w * s;
}

/* the current that flows in the true frame when the firmware's frame has it: turned by what its phase is wrong */
static void in_true_frame(const lira_state *st, const lira_place *at, double *dq) {
    for (int k = 0; k < SYSTEMS; k++) {
        double c = k == 4 ? st->cos_la : st->cos_ra[k / 2], s = k == 4 ? st->sin_la : st->sin_ra[k / 2];
        lira_turn t = k == 4 ? at->la : at->ra[k / 2];
        double along = c * t.c + s * t.s, across = s * t.c - c * t.s, d = st->lag[2 * k], q = st->lag[2 * k + 1];
        dq[2 * k] = along * d - across * q;
        dq[2 * k + 1] = across * d + along * q;
    }
}

/* forces of the reduced machine where the mover is */
static INLINE void push_reduced(const lira_params *p, lira_state *st, const lira_place *at) {
    double dq[10];
    in_true_frame(st, at, dq);
    lira_accelerate(p, st, at, dq);
}

/* what the reduced machine has of the electrical readings: no half-bridges */
static void show(lira_state *st) {
    lira_turn ra[2] = {{st->cos_ra[0], st->sin_ra[0]}, {st->cos_ra[1], st->sin_ra[1]}}, la = {st->cos_la, st->sin_la};
    join_all(st->lag, ra, la, st->coil_read);
    for (int k = 0; k < BRIDGES; k++) st->bridge_read[k] = st->u_read[k] = NAN;
}

static void follow(lira_state *st, const double *m) {
    for (int k = 0; k < 10; k++) {
        double u = st->currents_on ? st->wanted[k] : 0, x = st->lag[k] - u, v = st->lag[10 + k];
        st->lag[k] = u + m[0] * x + m[1] * v;
        st->lag[10 + k] = m[2] * x + m[3] * v;
    }
}

int64_t lira_run_reduced(const lira_params *p, const lira_control *c, lira_state *st, int64_t ticks, double *trace, int64_t every,
                 int32_t whole) {
    int64_t rows = 0;
    double m[4], step = LIRA_TICK * POSITION_TICKS, keep = lira_kept(p, step);
    lira_place at;
    lag_step(p->lag_rate, p->lag_damping, step, m);
    lira_locate(p, st, &at);
    for (int64_t n = 0; n < ticks; n += POSITION_TICKS) {
        lira_sight(p, st, step, keep);
        lira_positions(p, c, st);
        memcpy(st->coil_dq, st->lag, sizeof st->coil_dq);
        if (whole) show(st);
        if (every && st->tick % every == 0) {
            trace += tell_row(p, st, trace, whole);
            rows++;
        }
        push_reduced(p, st, &at); /* anew: the firmware's frame has jumped with the reading */
        kick(st, step / 2);
        follow(st, m);
        drift(st, step);
        lira_locate(p, st, &at);
        push_reduced(p, st, &at);
        kick(st, step / 2);
        lira_rates(st, &at);
        st->tick += POSITION_TICKS;
    }
    return rows;
}
