/* The mover. M x'' = F - D x' - friction + outer, J angle'' = T - K angle' - friction + outer, a bumper at both ends.
 * The bearing's balls roll and slip along one path, so there is one Coulomb force along the velocity of the shaft's surface
 * s = (x', r angle'): -coulomb s/|s|. Turning therefore takes friction off the axis along, and the other way round.
 * A kick over a time h is implicit: with the rates s_0 that there would be without friction and the compliances w (what an
 * impulse of 1 N s gives), s = s_0 - w h coulomb s/|s|, or rest if the impulse that is needed, s_0/w, is less than h coulomb.
 * For n = |s|
 *   sum (s_0k/(n + w_k h coulomb))^2 = 1,
 * where the left side S^2 falls; 1/S is all but straight, and Newton on it starts below the root at |s_0| - max w h coulomb. */
#include <math.h>
#include "rlsrm.h"
#include "numbers.h"

/* viscous friction by the trapezoidal rule */
void rlsrm_ready_mover(const rlsrm_params *p, double seconds, rlsrm_mover *m) {
    for (int k = 0; k < 2; k++) {
        double inertia = (k == X ? p->mass : p->inertia) + p->added[k], z = 0.5 * seconds * p->viscous[k] / inertia;
        m->keep[k] = (1 - z) / (1 + z);
        m->gain[k] = 1 / (inertia * (1 + z));
    }
    m->seconds = seconds;
}

/* the bumper only pushes */
double rlsrm_stop(const rlsrm_params *p, const rlsrm_state *st) {
    double into = fabs(st->q[X]) - p->stop;
    if (into <= 0) return 0;
    double away = st->q[X] > 0 ? -1 : 1;
    return away * most(p->stop_stiffness * into - away * p->stop_damping * st->v[X], 0);
}

/* along the path of the balls; `coulomb_sides`: how much more it is towards +x than on average, and less towards -x. The path is
 * that of the velocity `was` before the kick; what rests would go as it is pushed. (What is needed to stop it is no path: it
 * points as momentum does, of which a shaft that turns has far more than one that slides as fast.) */
static INLINE void rub_along_path(const rlsrm_params *p, const rlsrm_mover *m, const double *was, double *v) {
    double r = p->bearing_radius, wx = m->gain[X], wy = m->gain[ANGLE] * r * r, sx = v[X], sy = v[ANGLE] * r;
    double need_x = sx / wx, need_y = sy / wy, need = sqrt(need_x * need_x + need_y * need_y);
    if (need == 0) return;
    double impulse = m->seconds * p->coulomb;
    if (p->coulomb_sides != 0) {
        double went = hypot(was[X], was[ANGLE] * r);
        impulse *= 1 + p->coulomb_sides * (went > 0 ? was[X] / went : need_x / need);
    }
    if (need <= impulse) {
        v[X] = v[ANGLE] = 0;
        return;
    }
    double a = wx * impulse, b = wy * impulse, n = most(sqrt(sx * sx + sy * sy) - most(a, b), 0);
    for (int count = 0; count < 50; count++) {
        double per_a = 1 / (n + a), per_b = 1 / (n + b), ux = sx * per_a, uy = sy * per_b;
        double square = ux * ux + uy * uy, step = (sqrt(square) - 1) * square / (ux * ux * per_a + uy * uy * per_b);
        n += step;
        if (fabs(step) < 1e-7 * n) break; /* quadratic: what is left is below 1e-13 */
    }
    v[X] = sx * n / (n + a);
    v[ANGLE] = v[ANGLE] * n / (n + b);
}

static INLINE double rubbed(double v, double change) { return v > change ? v - change : v < -change ? v + change : 0; }

void rlsrm_kick(const rlsrm_params *p, const rlsrm_mover *m, rlsrm_state *st, const double *force) {
    double *v = st->v, was[2] = {v[X], v[ANGLE]};
    for (int k = 0; k < 2; k++)
        v[k] = p->locked[k] != 0 ? 0 : m->keep[k] * v[k] + m->gain[k] * m->seconds * force[k];
    if (p->along_path != 0) {
        if (p->coulomb > 0) rub_along_path(p, m, was, v);
    } else {
        v[X] = rubbed(v[X], m->gain[X] * m->seconds * p->coulomb);
        v[ANGLE] = rubbed(v[ANGLE], m->gain[ANGLE] * m->seconds * p->coulomb_angle);
    }
    for (int k = 0; k < 2; k++)
        if (p->brake[k] > 0) v[k] = rubbed(v[k], m->gain[k] * m->seconds * p->brake[k]);
}

void rlsrm_rub_once(const rlsrm_params *p, rlsrm_state *st, double seconds, const double *force) {
    rlsrm_mover m;
    rlsrm_ready_mover(p, seconds, &m);
    rlsrm_kick(p, &m, st, force);
}
