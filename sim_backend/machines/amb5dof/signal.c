/* What goes into the laws beside the readings: references, notch filters. */
#include <math.h>
#include <string.h>
#include "amb5dof.h"
#include "signal.h"

/* a set point goes to its target at `slew`, or at once (and then without a rate) where that is 0 */
static double slewed(double *set, double to, double slew) {
    double from = *set;
    *set = slew > 0 ? toward(from, to, slew * TICK) : to;
    return slew > 0 ? (*set - from) * PER_TICK : 0;
}

/* T (2.26), (3.16): y = A r sin(w t + p), z = B r cos(n w t + p), r going to 0 or 1 in a straight line; n is whole: 1 makes an
 * ellipse, other numbers other figures of Lissajous */
static void ellipse(const amb_control *c, amb_law_state *l, amb_motion *m) {
    double w = TWO_PI * c->ellipse_hz, n = floor(c->ellipse_ratio + 0.5), from = l->share, step = c->ellipse_ramp_s > TICK ? TICK / c->ellipse_ramp_s : 1;
    if (from == 0 && c->ellipse_on == 0) {
        l->phase = 0;
        return;
    }
    l->share = toward(from, c->ellipse_on != 0, step);
    l->phase += w * TICK;
    if (l->phase > TWO_PI) l->phase -= TWO_PI;
    double r = l->share, rate = step < 1 ? (r - from) * PER_TICK : 0;
    double s = sin(l->phase + c->ellipse_phase), q = cos(l->phase + c->ellipse_phase);
    double zs = n == 1 ? s : sin(n * l->phase + c->ellipse_phase), zq = n == 1 ? q : cos(n * l->phase + c->ellipse_phase);
    m->r[Y] += c->ellipse_y * r * s;
    m->v[Y] += c->ellipse_y * (r * w * q + rate * s);
    m->a[Y] += c->ellipse_y * (2 * rate * w * q - r * w * w * s);
    w *= n;
    m->r[Z] += c->ellipse_z * r * zq;
    m->v[Z] += c->ellipse_z * (rate * zq - r * w * zs);
    m->a[Z] -= c->ellipse_z * (2 * rate * w * zs + r * w * w * zq);
}

/* From rest to the set points and back by the smooth step 3 t^2 - 2 t^3. */
static void lift(const amb_control *c, amb_law_state *l, amb_motion *m) {
    double t = l->lift_clock / c->lift_time_s, per = 1 / c->lift_time_s, sign = l->mode == LIFT ? 1 : -1;
    double up = t * t * (3 - 2 * t), v = sign * 6 * t * (1 - t) * per, a = sign * (6 - 12 * t) * per * per;
    up = l->mode == LIFT ? up : 1 - up;
    l->lift_clock += TICK;
    if (l->lift_clock > c->lift_time_s) l->lift_clock = c->lift_time_s;
    for (int k = 0; k < 5; k++) {
        double way = m->r[k] - l->rest[k];
        m->r[k] = l->rest[k] + up * way;
        m->v[k] = up * m->v[k] + v * way;
        m->a[k] = up * m->a[k] + a * way;
    }
}

void amb_refer(const amb_control *c, amb_law_state *l, amb_motion *m) {
    const double to[5] = {c->ref_x, c->ref_y, c->ref_z, c->ref_psi, c->ref_theta};
    memset(m, 0, sizeof *m);
    for (int k = 0; k < 5; k++) {
        m->v[k] = slewed(l->set + k, to[k], k < PSI ? c->slew : c->slew_tilt);
        m->r[k] = l->set[k];
    }
    ellipse(c, l, m);
    if (l->mode != LEVITATE) lift(c, l, m);
}

/* (s^2 + w^2)/(s^2 + s w/Q + w^2) by the bilinear transform, prewarped at w */
static void design(amb_notch *n, int k, double hz, double q) {
    n->hz[k] = hz;
    n->q[k] = q;
    double g = tan(TWO_PI / 2 * hz * TICK), a = 1 / (1 + g / q + g * g);
    n->c[3 * k] = (1 + g * g) * a;
    n->c[3 * k + 1] = 2 * (g * g - 1) * a;
    n->c[3 * k + 2] = (1 - g / q + g * g) * a;
}

void amb_notched(const amb_control *c, amb_notch *n, double *radial) {
    const double hz[2] = {c->notch1_hz, c->notch2_hz}, q[2] = {c->notch1_q, c->notch2_q};
    for (int k = 0; k < 2; k++) {
        if (hz[k] <= 0) {
            n->hz[k] = 0;
            continue;
        }
        int fresh = n->hz[k] == 0;
        if (hz[k] != n->hz[k] || q[k] != n->q[k]) design(n, k, hz[k], q[k]);
        const double *f = n->c + 3 * k;
        for (int a = 0; a < 4; a++) radial[a] = notched(f, n->past + 8 * k + 2 * a, radial[a], fresh);
    }
}
