/* What goes into the law beside the readings: set points, path, lift. */
#include <math.h>
#include <string.h>
#include "signal.h"
#include "twin.h"

/* a set point goes to its target at `slew`, or at once (and then without a rate) where that is 0 */
static double slewed(double *set, double to, double slew, double tick) {
    double from = *set;
    if (from == to) return 0;
    *set = slew > 0 ? toward(from, to, slew * tick) : to;
    return slew > 0 ? (*set - from) / tick : 0;
}

/* y = A r sin(w t + p), z = B r cos(n w t + p), r going to 0 or 1 in a straight line; n whole turns of z in one of y */
static void path(const twin_control *c, twin_law_state *l, double tick, double *r, double *v) {
    double w = TWO_PI * c->path_hz, n = floor(c->path_ratio + 0.5), from = l->share;
    double step = c->path_ramp_s > tick ? tick / c->path_ramp_s : 1;
    if (from == 0 && c->path_on == 0) {
        l->phase = 0;
        return;
    }
    l->share = toward(from, c->path_on != 0, step);
    l->phase += w * tick;
    if (l->phase > TWO_PI) l->phase -= TWO_PI;
    double a = l->share, rate = step < 1 ? (a - from) / tick : 0;
    double s = sin(l->phase + c->path_phase), q = cos(l->phase + c->path_phase);
    double zs = n == 1 ? s : sin(n * l->phase + c->path_phase), zq = n == 1 ? q : cos(n * l->phase + c->path_phase);
    r[Y] += c->path_y * a * s;
    v[Y] += c->path_y * (a * w * q + rate * s);
    r[Z] += c->path_z * a * zq;
    v[Z] += c->path_z * (rate * zq - a * n * w * zs);
}

/* From rest to the set points and back by the smooth step 3 t^2 - 2 t^3. */
static void lift(const twin_control *c, twin_law_state *l, double tick, int axes, double *r, double *v) {
    double t = l->lift_clock / c->lift_time_s, per = 1 / c->lift_time_s, sign = l->mode == LIFT ? 1 : -1;
    double up = t * t * (3 - 2 * t), rate = sign * 6 * t * (1 - t) * per;
    up = l->mode == LIFT ? up : 1 - up;
    l->lift_clock += tick;
    if (l->lift_clock > c->lift_time_s) l->lift_clock = c->lift_time_s;
    for (int k = 0; k < axes; k++) {
        double way = r[k] - l->rest[k];
        r[k] = l->rest[k] + up * way;
        v[k] = up * v[k] + rate * way;
    }
}

/* Where each axis is to be, and how fast: its own set point, and what the shaft's and the path make of it in its plane. */
void twin_refer(const twin_params *p, const twin_control *c, twin_law_state *l, double *r, double *v) {
    double shaft[5], rate[5];
    int axes = p->radial + p->axial, shifted = 0;
    for (int k = 0; k < axes; k++) {
        v[k] = slewed(l->set_axis + k, c->ref_axis[k], c->slew, p->tick);
        r[k] = l->set_axis[k];
    }
    for (int j = 0; j < 5; j++) {
        rate[j] = slewed(l->set + j, c->ref[j], j < PSI ? c->slew : c->slew_tilt, p->tick);
        shaft[j] = l->set[j];
    }
    path(c, l, p->tick, shaft, rate);
    for (int j = 0; j < 5; j++) shifted |= shaft[j] != 0 || rate[j] != 0;
    for (int j = 0; shifted && j < 5; j++) {
        for (int k = 0; k < axes; k++) {
            r[k] += c->steer[16 * j + k] * shaft[j];
            v[k] += c->steer[16 * j + k] * rate[j];
        }
    }
    if (l->mode != LEVITATE) lift(c, l, p->tick, axes, r, v);
}
