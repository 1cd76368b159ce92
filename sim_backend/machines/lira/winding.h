/* Six coils of a rotary actuator and their two three-phase systems, L (1) as corrected: torque R and bearing B,
 *   i1 = aR + aB, i2 = bR - cB, i3 = cR + bB, i4 = aR - aB, i5 = bR + cB, i6 = cR - bB,
 * whose inverse is its transpose over two. In each system b leads a by 120 degrees, against the order of the textbooks; a system
 * is its space vector (2/3)(a + b e^-j120 + c e^-j240). */
#ifndef WINDING_H
#define WINDING_H
#include "lira.h"
#include "numbers.h"

#define HALF_ROOT_3 0.86602540378443865
#define THIRD_ROOT_3 0.57735026918962576

/* phases to a space vector, which a turn takes into its own frame (dq) */
static INLINE void in_frame(double a, double b, double c, lira_turn t, double *dq) {
    double along = (2 * a - b - c) * (1.0 / 3), across = THIRD_ROOT_3 * (c - b);
    dq[0] = along * t.c + across * t.s;
    dq[1] = across * t.c - along * t.s;
}

static INLINE void to_phases(const double *dq, lira_turn t, double *a, double *b, double *c) {
    double along = dq[0] * t.c - dq[1] * t.s, across = HALF_ROOT_3 * (dq[0] * t.s + dq[1] * t.c);
    *a = along;
    *b = -0.5 * along - across;
    *c = -0.5 * along + across;
}

/* (d, q) of R and of B of six coils */
static INLINE void split(const double *i, lira_turn t, double *dq) {
    in_frame(0.5 * (i[0] + i[3]), 0.5 * (i[1] + i[4]), 0.5 * (i[2] + i[5]), t, dq);
    in_frame(0.5 * (i[0] - i[3]), 0.5 * (i[2] - i[5]), 0.5 * (i[4] - i[1]), t, dq + 2);
}

static INLINE void join(const double *dq, lira_turn t, double *i) {
    double a, b, c, d, e, f;
    to_phases(dq, t, &a, &b, &c);
    to_phases(dq + 2, t, &d, &e, &f);
    i[0] = a + d;
    i[1] = b - f;
    i[2] = c + e;
    i[3] = a - d;
    i[4] = b + f;
    i[5] = c - e;
}

/* all five systems R1 B1 R2 B2 L of fifteen coils, and back */
static INLINE void split_all(const double *i, const lira_turn *ra, lira_turn la, double *dq) {
    split(i, ra[0], dq);
    split(i + 6, ra[1], dq + 4);
    in_frame(i[12], i[13], i[14], la, dq + 8);
}

static INLINE void join_all(const double *dq, const lira_turn *ra, lira_turn la, double *i) {
    join(dq, ra[0], i);
    join(dq + 4, ra[1], i + 6);
    to_phases(dq + 8, la, i + 12, i + 13, i + 14);
}
#endif
