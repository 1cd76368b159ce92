/* Time: ticks of 50 us of the amplifiers, in each of which voltages are held; every twentieth the controller. A step is half a
 * kick of the mover, its way, currents and forces where it is then, and the other half: the second order of both halves. */
#include <math.h>
#include <string.h>
#include "rlsrm.h"
#include "numbers.h"

void rlsrm_start(const rlsrm_params *p, rlsrm_state *st) {
    memset(st, 0, sizeof *st);
    st->fresh = 1;
    st->pending = -1;
    st->heard = -1;
    st->homed[X] = st->homed[ANGLE] = 1;
    st->pair[0] = st->pair[1] = -1;
    for (int k = 0; k < PHASES; k++) st->warm[k] = p->ambient;
}

/* readings, truth and its rates, set points, what loops ask and the distribution gives by its map, what acts; currents, voltages;
 * their references; pair as 6 a + b, flags, changes of the pair; state, fault, age of the heartbeat */
static void tell(const rlsrm_state *st, double *out) {
    for (int k = 0; k < 2; k++) {
        out[k] = st->read[k];
        out[2 + k] = st->q[k];
        out[4 + k] = st->v[k];
        out[6 + k] = st->ref[k];
        out[8 + k] = st->asked[k];
        out[10 + k] = st->given[k];
        out[12 + k] = st->force[k];
    }
    memcpy(out + 14, st->i, sizeof st->i);
    memcpy(out + 20, st->u, sizeof st->u);
    memcpy(out + 26, st->wanted, sizeof st->wanted);
    out[32] = 6 * st->pair[0] + st->pair[1];
    out[33] = st->flags;
    out[34] = (double)st->changes;
    out[35] = st->mode;
    out[36] = st->fault;
    out[37] = st->heard >= 0 ? (double)(st->tick - st->heard) * RLSRM_TICK : -1;
}

/* who hangs something lets it go evenly */
static void hand_over(const rlsrm_params *p, rlsrm_state *st) {
    for (int k = 0; k < 2; k++) {
        double step = p->hung_rate[k] * LOOP_S;
        st->hanging[k] += clip(p->hung[k] - st->hanging[k], -step, step);
    }
}

/* who winds the load cells takes them past their place on one side and back: along first and around last, for what turns has no
 * friction along */
static void wind(const rlsrm_params *p, rlsrm_state *st) {
    if (st->cell_stage == 0) return;
    int there = 1;
    for (int k = 0; k < 2; k++) {
        int past = st->cell_stage == 1 || (st->cell_stage == 2 && k == ANGLE);
        double to = st->cell_at[k] + (past ? st->cell_side * p->cell_past[k] : 0), step = p->cell_rate[k] * LOOP_S;
        double left = to - st->cell_now[k];
        st->cell_now[k] = fabs(left) <= step ? to : st->cell_now[k] + (left > 0 ? step : -step);
        there &= st->cell_now[k] == to;
    }
    if (there) st->cell_stage = (st->cell_stage + 1) % 4;
}

/* means over a period, and what copper has warmed by them */
static void end_period(const rlsrm_params *p, rlsrm_state *st) {
    for (int k = 0; k < PHASES; k++) {
        st->mean[k] = st->running[k] / LOOP_TICKS;
        st->square[k] = st->running_square[k] / LOOP_TICKS;
        st->running[k] = st->running_square[k] = 0;
        double heat = p->resistance[k] * (1 + p->copper * (st->warm[k] - 20)) * st->square[k];
        st->warm[k] += LOOP_S / p->thermal_capacity * (heat - (st->warm[k] - p->ambient) / p->thermal_resistance);
    }
    hand_over(p, st);
    wind(p, st);
}

static INLINE void kick(const rlsrm_params *p, const rlsrm_mover *m, rlsrm_state *st) {
    double outer = rlsrm_stop(p, st) + p->push[X] + p->mass * p->gravity * p->tilt;
    double force[2] = {st->force[X] + outer + st->hanging[X], st->force[ANGLE] + p->push[ANGLE] + st->hanging[ANGLE]};
    for (int k = 0; k < 2; k++)
        if (p->cell_stiffness[k] > 0)
            force[k] += p->cell_stiffness[k] * (st->cell_now[k] - st->q[k]) - p->cell_damping[k] * st->v[k];
    rlsrm_kick(p, m, st, force);
}

/* what clamps gives way by what it holds, at once */
static INLINE double given_way(const rlsrm_params *p, const rlsrm_state *st, int k) {
    double weight = k == X ? p->mass * p->gravity * p->tilt : 0;
    return p->lock_give[k] * (st->force[k] + p->push[k] + st->hanging[k] + weight);
}

static INLINE void tick(const rlsrm_params *p, const rlsrm_control *c, const rlsrm_ready *map, const rlsrm_mover *half, int steps,
                        rlsrm_state *st) {
    double before[PHASES], u[PHASES], seconds = 2 * half->seconds;
    if (st->pending >= 0 && st->pending-- == 0) memcpy(st->wanted, st->next, sizeof st->wanted);
    rlsrm_amplifiers(p, c, st, u);
    if (st->pulse_left > 0) st->pulse_left--;
    for (int n = 0; n < steps; n++) {
        kick(p, half, st);
        for (int k = 0; k < 2; k++)
            st->q[k] = p->locked[k] != 0 ? st->lock_at[k] + given_way(p, st, k) : st->q[k] + seconds * st->v[k];
        memcpy(before, st->g, sizeof before);
        memcpy(st->u, u, sizeof u);
        rlsrm_look(map, st->q, st->g, st->along, st->around);
        rlsrm_currents(p, st, before, st->u, seconds);
        rlsrm_forces(p, st);
        kick(p, half, st);
    }
    for (int k = 0; k < PHASES; k++) {
        st->running[k] += st->i[k];
        st->running_square[k] += st->i[k] * st->i[k];
    }
}

/* maps, mover and step made ready for a run */
typedef struct {
    rlsrm_ready truth, believed;
    rlsrm_mover half;
    int steps;
} rlsrm_clock;

static void begin(const rlsrm_params *p, const rlsrm_control *c, rlsrm_state *st, rlsrm_clock *k) {
    k->steps = (int)most(p->substeps, 1);
    rlsrm_make_ready(&p->map, &k->truth);
    rlsrm_make_ready(&c->map, &k->believed);
    rlsrm_ready_mover(p, 0.5 * RLSRM_TICK / k->steps, &k->half);
    rlsrm_look(&k->truth, st->q, st->g, st->along, st->around);
    rlsrm_forces(p, st);
    for (int a = 0; a < 2; a++) {
        if (p->locked[a] != 0 && !st->lock_shut[a]) st->lock_at[a] = st->q[a] - given_way(p, st, a);
        st->lock_shut[a] = p->locked[a] != 0;
    }
}

int64_t rlsrm_run(const rlsrm_params *p, const rlsrm_control *c, rlsrm_state *st, int64_t ticks, double *trace, int64_t every) {
    int64_t rows = 0;
    rlsrm_clock k;
    begin(p, c, st, &k);
    for (int64_t n = 0; n < ticks; n++) {
        if (st->tick % LOOP_TICKS == 0) rlsrm_loops(p, c, &k.believed, st);
        if (every && st->tick % every == 0) {
            tell(st, trace);
            trace += RLSRM_TRACE;
            rows++;
        }
        tick(p, c, &k.truth, &k.half, k.steps, st);
        st->tick++;
        if (st->tick % LOOP_TICKS == 0) end_period(p, st);
    }
    return rows;
}

/* what the controller tells once a period: readings, set points, what is asked for and given by its map, rates, currents in the
 * mean as the six amplifiers have them (without what their sensors add), the stators' hottest windings, pair, flags; state, fault */
static void report(const rlsrm_params *p, const rlsrm_state *st, double *out) {
    int closed = st->loop[X] || st->loop[ANGLE];
    for (int k = 0; k < 2; k++) {
        out[k] = st->read[k];
        out[2 + k] = st->ref[k];
        out[4 + k] = closed ? st->asked[k] : 0;
        out[6 + k] = closed ? st->given[k] : 0;
        out[8 + k] = st->rate_slow[k];
        out[16 + k] = most(most(st->warm[3 * k], st->warm[3 * k + 1]), st->warm[3 * k + 2]);
    }
    for (int k = 0; k < PHASES; k++) out[10 + k] = st->mean[(int)p->wired[k]];
    out[18] = closed && st->pair[0] >= 0 ? st->pair[0] + 8 * st->pair[1] : 63;
    out[19] = (closed ? st->flags : 0) | (st->homed[X] && st->homed[ANGLE] ? HOMED : 0);
    out[20] = st->mode;
    out[21] = st->fault;
}

/* of one tick: readings of the loop, currents at the instant, voltages over the tick before it, what the loops ask for */
static void record(const rlsrm_params *p, const rlsrm_state *st, double *out) {
    for (int k = 0; k < 2; k++) {
        out[k] = st->read[k];
        out[14 + k] = st->asked[k];
    }
    for (int k = 0; k < PHASES; k++) {
        out[2 + k] = st->i[(int)p->wired[k]];
        out[8 + k] = st->u[(int)p->wired[k]];
    }
}

/* as `rlsrm_run`: a row of each reading of the loops; of every so many ticks, which are counted `shift` on from here, a record */
void rlsrm_serve(const rlsrm_params *p, const rlsrm_control *c, rlsrm_state *st, int64_t ticks, double *rows, double *trace,
                 int64_t every, int64_t shift) {
    rlsrm_clock k;
    begin(p, c, st, &k);
    for (int64_t n = 0; n < ticks; n++) {
        if (st->tick % LOOP_TICKS == 0) {
            rlsrm_loops(p, c, &k.believed, st);
            report(p, st, rows);
            rows += RLSRM_ROW;
        }
        if (every && (st->tick + shift) % every == 0) {
            record(p, st, trace);
            trace += RLSRM_READINGS;
        }
        tick(p, c, &k.truth, &k.half, k.steps, st);
        st->tick++;
        if (st->tick % LOOP_TICKS == 0) end_period(p, st);
    }
}
