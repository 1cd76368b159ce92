/* What is put on the mover: a mass that hangs on its axis, and a part that turns with it, such as a ring, whose middle may be off the
 * axis and which may slip. Accelerations of the bare mover, which lira_accelerate made, become those of both. */
#include <math.h>
#include "lira.h"

/* m, and first and second moments about the mover's centre of mass, of everything; determinant */
typedef struct {
    double m, couple, turn, det;
} body;

static body whole(const lira_params *p) {
    body b = {p->mass + p->hung + p->part, p->hung * p->hung_at + p->part * p->part_at,
              p->transverse_inertia + 0.5 * p->part_inertia + p->hung * p->hung_at * p->hung_at + p->part * p->part_at * p->part_at, 0};
    b.det = b.m * b.turn - b.couple * b.couple;
    return b;
}

/* What is h from the centre of mass moves as x + h beta and y - h alpha, and pulls down there with N:
 *   [m + dm, +-dm h; +-dm h, J_t + dm h^2] a = what acts, + across, - upwards */
static void carried(const lira_params *p, lira_state *st, const body *b) {
    double weight = p->hung_N + p->part_N, moment = p->hung_at * p->hung_N + p->part_at * p->part_N;
    double across = p->mass * st->a[0], around = p->transverse_inertia * st->a[3];
    double up = p->mass * st->a[1] - weight, over = p->transverse_inertia * st->a[2] + moment;
    st->a[0] = (b->turn * across - b->couple * around) / b->det;
    st->a[3] = (b->m * around - b->couple * across) / b->det;
    st->a[1] = (b->turn * up + b->couple * over) / b->det;
    st->a[2] = (b->m * over + b->couple * up) / b->det;
    st->a[4] *= p->mass / b->m;
}

/* a force on the axis where the part sits */
static void pushed(const lira_params *p, lira_state *st, const body *b, double x, double y) {
    double moves = (b->turn - b->couple * p->part_at) / b->det, tilts = (b->m * p->part_at - b->couple) / b->det;
    st->a[0] += moves * x;
    st->a[3] += tilts * x;
    st->a[1] += moves * y;
    st->a[2] -= tilts * y;
}

/* The part's middle stands at x + e cos t, y - e sin t, t = angle + slip + phase (the angle counts from y to x). By Lagrange, with
 * X, Y the axis there and w = t':
 *   X'' and Y'' answer to   m e (t'' sin t + w^2 cos t)   and   m e (t'' cos t - w^2 sin t)
 *   (J_part + m e^2) t'' = torque between mover and part + e (N cos t) + m e (X'' sin t + Y'' cos t)
 * It slips where that torque would be more than it bears. */
static void turned(const lira_params *p, lira_state *st, const body *b) {
    double t = st->q[5] + st->slip[0] + p->part_phase, c = cos(t), s = sin(t), w = st->v[5] + st->slip[1];
    double off = p->part * p->part_off, here = p->part_at, torque = p->polar_inertia * st->a[5];
    pushed(p, st, b, off * w * w * c, -off * w * w * s);
    double X = st->a[0] + here * st->a[3], Y = st->a[1] - here * st->a[2];
    double gives = (b->turn - 2 * b->couple * here + b->m * here * here) / b->det; /* of the axis there, to a force there */
    double own = p->part_inertia + p->part * p->part_off * p->part_off - off * off * gives;
    double acts = p->part_off * p->part_N * c + off * (X * s + Y * c);
    double both = (torque + acts) / (p->polar_inertia + own), passed = torque - p->polar_inertia * both;
    double way = st->slip[1] != 0 ? -copysign(1, st->slip[1]) : copysign(1, passed);
    st->a[5] = both;
    st->slip[2] = 0;
    if (st->slip[1] != 0 || fabs(passed) > p->part_grip) {
        st->a[5] = (torque - way * p->part_grip) / p->polar_inertia;
        st->slip[2] = (way * p->part_grip + acts) / own - st->a[5];
    }
    double turns = st->a[5] + st->slip[2];
    pushed(p, st, b, off * turns * s, off * turns * c);
}

void lira_load(const lira_params *p, lira_state *st) {
    body b = whole(p);
    carried(p, st, &b);
    if (p->part > 0) turned(p, st, &b);
}
