/* The map of inductances. G(angle, x) of a phase is what its flux would be per ampere without iron that saturates:
 *   G = ov(o) Lam(d) [1 + uneven cos(angle - phase)],   o = overlap + side (x - centre),   side = -1, +1,
 *   ov = 1/2 [l + sqrt(o^2 + w^2) - sqrt((o - l)^2 + w^2)]           (o within the stack, 0 before it, l behind it),
 *   Lam = slope gain [u + (1 - u) f],  f = (h(d) - h(45 deg))/(h(0) - h(45 deg)),  h = cos 4d + c2 cos 8d + c3 cos 12d,
 * d = angle - aligned - zero. Poles of the stator stand 60 degrees apart and the rotor's 90, so that B, at 60 degrees, is aligned
 * at 60 and C, at 120, at 30 degrees. With c = cos 4d: h = c + c2 (2 c^2 - 1) + c3 (4 c^3 - 3 c), dh/dd = -4 sin 4d dh/dc.
 * Co-energy W' = leakage i^2/2 + G q(i), q = integral of i/sqrt(1 + (i/s)^2) = s^2 (sqrt(1 + (i/s)^2) - 1): so force and torque
 * are slopes of G times q, and q(i) = i^2/2 only while i is small against s (R (9), which takes it for granted). */
#include <math.h>
#include "rlsrm.h"
#include "numbers.h"

/* cosines and sines of four times the aligned angles of A, B, C: 0, 240, 120 degrees */
static const double COS[3] = {1, -0.5, -0.5}, SIN[3] = {0, -0.86602540378443865, 0.86602540378443865};

void rlsrm_make_ready(const rlsrm_map *m, rlsrm_ready *r) {
    double lowest = -1 + m->c2 - m->c3, range = 2 + 2 * m->c3; /* h(45 degrees), and h(0) above it */
    for (int k = 0; k < PHASES; k++) {
        double c = cos(4 * m->zero[k / 3]), s = sin(4 * m->zero[k / 3]);
        r->c[k] = c * COS[k % 3] - s * SIN[k % 3];
        r->s[k] = s * COS[k % 3] + c * SIN[k % 3];
        r->swing[k] = m->slope * m->gain[k] * (1 - m->unaligned) / range;
        r->base[k] = m->slope * m->gain[k] * m->unaligned - r->swing[k] * lowest;
    }
    r->c2 = m->c2;
    r->c3 = m->c3;
    r->length = m->length;
    r->overlap = m->overlap;
    r->fringe_2 = m->fringe * m->fringe;
    r->centre = m->centre;
    r->uneven = m->uneven;
    r->uneven_c = cos(m->uneven_phase);
    r->uneven_s = sin(m->uneven_phase);
}

void rlsrm_look(const rlsrm_ready *r, const double *q, double *g, double *along, double *around) {
    double c1 = cos(q[ANGLE]), s1 = sin(q[ANGLE]), c2 = c1 * c1 - s1 * s1, s2 = 2 * s1 * c1;
    double c4 = c2 * c2 - s2 * s2, s4 = 2 * s2 * c2;
    double even = 1 + r->uneven * (c1 * r->uneven_c + s1 * r->uneven_s), turn = r->uneven * (c1 * r->uneven_s - s1 * r->uneven_c);
    double over[PHASES], rise[PHASES];
    for (int a = 0; a < 2; a++) {
        double side = a ? 1 : -1, o = r->overlap + side * (q[X] - r->centre), far = o - r->length;
        double near_r = sqrt(o * o + r->fringe_2), far_r = sqrt(far * far + r->fringe_2);
        for (int k = 3 * a; k < 3 * a + 3; k++) {
            over[k] = 0.5 * (r->length + near_r - far_r);
            rise[k] = side * 0.5 * (o / near_r - far / far_r);
        }
    }
    for (int k = 0; k < PHASES; k++) {
        double c = c4 * r->c[k] + s4 * r->s[k], s = s4 * r->c[k] - c4 * r->s[k];
        double h = c + r->c2 * (2 * c * c - 1) + r->c3 * (4 * c * c - 3) * c;
        double slope = -4 * s * (1 + 4 * r->c2 * c + r->c3 * (12 * c * c - 3));
        double lam = r->base[k] + r->swing[k] * h;
        g[k] = over[k] * lam * even;
        along[k] = rise[k] * lam * even;
        around[k] = over[k] * (r->swing[k] * slope * even + lam * turn);
    }
}

void rlsrm_slopes(const rlsrm_map *m, const double *q, double *g, double *along, double *around) {
    rlsrm_ready r;
    rlsrm_make_ready(m, &r);
    rlsrm_look(&r, q, g, along, around);
}
