/* The mover: forces by the coils' flux, pull of the magnets, cogging, touchdown rings (L (15)-(18), general: with a transverse
 * inertia of its own and off the middle).
 *   F = K_B (i_d, i_q)_B + K_pull (x + m),  T = K_R i_q,R + P K_B (x i_q,B - y i_d,B),  F_z = K_L i_q,L - F_c sin 2 theta
 * Planes are the stator's: x_k = x + beta s_k, y_k = y - alpha s_k with s_k = +-l - (z - z_mid), so what pulls a tilted mover
 * sideways pulls it along z, too. The mover turns against the angle's count: gyroscopic terms have -J angle'. */
#include <math.h>
#include "winding.h"

static INLINE lira_turn turned(double angle) { return (lira_turn){cos(angle), sin(angle)}; }

static INLINE lira_turn doubled(lira_turn t) { return (lira_turn){t.c * t.c - t.s * t.s, 2 * t.s * t.c}; }

static INLINE lira_turn back(lira_turn t, double c, double s) { return (lira_turn){t.c * c + t.s * s, t.s * c - t.c * s}; }

void lira_rates(const lira_state *st, lira_place *at) {
    const double *q = st->q, *v = st->v;
    for (int a = 0; a < 2; a++) {
        at->vx[a] = v[0] + v[3] * at->lever[a] - q[3] * v[Z];
        at->vy[a] = v[1] - v[2] * at->lever[a] + q[2] * v[Z];
    }
}

void lira_locate(const lira_params *p, const lira_state *st, lira_place *at) {
    const double *q = st->q;
    at->angle = turned(q[ANGLE]);
    lira_turn phase = doubled(doubled(doubled(at->angle)));
    for (int a = 0; a < 2; a++) {
        double lever = (a ? -1 : 1) * p->bearing_plane - (q[Z] - p->middle);
        at->ra[a] = back(phase, st->zero_c[a], st->zero_s[a]);
        at->lever[a] = lever;
        at->x[a] = q[0] + q[3] * lever;
        at->y[a] = q[1] - q[2] * lever;
    }
    at->la = back(turned(TWO_PI / p->pair_pitch * q[Z]), st->zero_c[2], st->zero_s[2]);
    lira_rates(st, at);
}

static double clearance(const lira_params *p, double z) {
    double share = clip((z - p->edge_in) / (p->edge_out - p->edge_in), 0, 1);
    return p->clearance + share * (p->clearance_out - p->clearance);
}

typedef struct {
    double x, y, z, turn;
} pull;

/* ring against mover: a stiff spring with damping, and Coulomb friction against the way in which its surface slips */
static INLINE double touched(const lira_params *p, const lira_state *st, const lira_place *at, int a, pull *f) {
    double x = at->x[a], y = at->y[a], r = sqrt(x * x + y * y), into = r - clearance(p, st->q[Z]);
    if (into <= 0) return 0;
    double normal = most(p->ring_stiffness * into + p->ring_damping * (x * at->vx[a] + y * at->vy[a]) / r, 0);
    double along = st->v[Z], around = p->ring_radius * st->v[ANGLE], slip = sqrt(along * along + around * around);
    double held = slip > 0 ? p->ring_friction * normal * tanh(slip / p->slip_speed) / slip : 0;
    f->x -= normal * x / r;
    f->y -= normal * y / r;
    f->z -= held * along;
    f->turn -= held * around * p->ring_radius;
    return normal;
}

/* how the magnets stand off the middle of a plane; what is uneven turns with the mover */
static INLINE void magnets(const lira_params *p, const lira_state *st, const lira_place *at, int a, double *x, double *y) {
    *x = p->centre[a];
    *y = p->centre[2 + a];
    if (p->uneven[a] == 0) return;
    lira_turn t = back(at->angle, st->uneven_c[a], st->uneven_s[a]); /* it turns from y to x */
    *x += p->uneven[a] * t.c;
    *y -= p->uneven[a] * t.s;
}

/* accelerations by the place and the true dq currents R1 B1 R2 B2 L; `contact` is what the rings bear */
void lira_accelerate(const lira_params *p, lira_state *st, const lira_place *at, const double *dq) {
    const double *q = st->q, *v = st->v;
    lira_turn twice = doubled(at->la), fourth = doubled(twice);
    double drive = p->force_constant * dq[9] - p->cogging_force * twice.s - p->cogging_force_2 * fourth.s;
    double torque = p->push[5], sum_x = 0, sum_y = 0, tilt_x = 0, tilt_y = 0, along = p->push[4];
    st->contact = 0;
    for (int a = 0; a < 2; a++) {
        double mx, my;
        magnets(p, st, at, a, &mx, &my);
        pull f = {p->bearing_constant[a] * dq[4 * a + 2] + p->pull[a] * (at->x[a] + mx) + p->push[a],
                  p->bearing_constant[a] * dq[4 * a + 3] + p->pull[a] * (at->y[a] + my) + p->push[2 + a], 0, 0};
        lira_turn two = doubled(at->ra[a]), four = doubled(two);
        torque -= 0.5 * p->cogging_torque * (four.s * two.c + four.c * two.s); /* sin 6 phi: each has its half */
        torque += p->torque_constant[a] * dq[4 * a + 1]
                  + POLE_PAIRS * p->bearing_constant[a] * (at->x[a] * dq[4 * a + 3] - at->y[a] * dq[4 * a + 2]);
        st->contact += touched(p, st, at, a, &f);
        sum_x += f.x;
        sum_y += f.y;
        tilt_x -= at->lever[a] * f.y;
        tilt_y += at->lever[a] * f.x;
        along += f.z - q[3] * f.x + q[2] * f.y;
        torque += f.turn;
    }
    if (q[Z] < p->stop_z) along += -p->stop_stiffness * (q[Z] - p->stop_z) - p->stop_damping * v[Z];
    double spin = -(p->polar_inertia + p->part_inertia) * v[ANGLE];
    st->a[0] = sum_x / p->mass;
    st->a[1] = sum_y / p->mass - p->gravity;
    st->a[2] = (tilt_x + p->eccentric[1] * drive - spin * v[3]) / p->transverse_inertia;
    st->a[3] = (tilt_y - p->eccentric[0] * drive + spin * v[2]) / p->transverse_inertia;
    st->a[Z] = (drive + along) / p->mass;
    st->a[ANGLE] = torque / p->polar_inertia;
    if (p->hung > 0 || p->part > 0) lira_load(p, st);
}
