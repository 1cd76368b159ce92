/* Mechanics of the rotor. With q = (x, y, z, psi, theta), a plane at the station s is at y + s theta, z - s psi, and an axis
 * that pulls along (c, d) there at c (y + s theta) + d (z - s psi) = a' q: a force F of it is the wrench a F.
 *   m r'' = sum F + m g + unbalance,  I psi'' = M_psi - I_p w theta',  I theta'' = M_theta + I_p w psi'. */
#include <math.h>
#include <string.h>
#include "twin.h"

#define NEAREST 1e-4 /* of a gap: nearer, the iron saturates */

/* by their places: vectors that are handed over depend on the processor */
static INLINE double sum(const v4 *a) { return ((*a)[0] + (*a)[1]) + ((*a)[2] + (*a)[3]); }

static INLINE void at_least(v4 *a, double least) {
    v4 low = {least, least, least, least};
    m4 over = *a > low;
    *a = (v4)(((m4)*a & over) | ((m4)low & ~over));
}

/* F = beta (ip^2/(gap - xi)^2 - in^2/(gap + xi)^2) of four axes, and their sums by coordinate */
static INLINE void attract(int flexible, const twin_params *p, int blocks, const double *s, const double *coil, wrench *w) {
    v4 total[8] = {{0}};
    const double q[8] = {s[Y], s[Z], s[PSI], s[THETA], s[12], s[13], s[14], s[15]};
    int n = flexible ? 8 : 4;
    for (int b = 0; b < blocks; b++) {
        int k = 4 * b;
        v4 xi = *(const v4 *)(p->offset + k), gap = *(const v4 *)(p->gap + k);
        for (int j = 0; j < n; j++) xi += *(const v4 *)(p->axis + 16 * j + k) * q[j];
        v4 near = gap - xi, far = gap + xi;
        at_least(&near, NEAREST);
        at_least(&far, NEAREST);
        v4 a = *(const v4 *)(coil + k) * far, c = *(const v4 *)(coil + 16 + k) * near, both = near * far;
        v4 f = *(const v4 *)(p->beta + k) * (a - c) * (a + c) / (both * both);
        for (int j = 0; j < n; j++) total[j] += *(const v4 *)(p->axis + 16 * j + k) * f;
    }
    w->y += sum(total), w->z += sum(total + 1), w->psi += sum(total + 2), w->theta += sum(total + 3);
    for (int j = 4; j < n; j++) w->modal[j - 4] += sum(total + j);
}

void twin_plane(const twin_derived *d, const double *s, double station, const double *shape, double *y, double *z) {
    placed(d->flexible, 1, s, station, shape, y, z);
}

static void touchdown(const twin_params *p, const twin_derived *d, const double *s, int k, wrench *w) {
    double y, z, fy, fz, brake, station = p->ring[k];
    const ring at = {p->clearance[k], p->ring_stiffness, p->ring_damping, p->ring_friction, p->ring_radius};
    const double *shape = p->shape_ring + 2 * k;
    double vy = s[6 + Y] + station * s[6 + THETA], vz = s[6 + Z] - station * s[6 + PSI];
    twin_plane(d, s, station, shape, &y, &z);
    if (!touched(&at, y, z, vy, vz, s[11], &fy, &fz, &brake)) return;
    pushed(d->flexible, 1, w, station, shape, fy, fz);
    w->torque -= brake;
}

static void thrust(const twin_params *p, const double *s, const double *coil, wrench *w) {
    double xi = p->sense_x * s[X] + p->offset_x;
    double near = p->gap_x - xi > NEAREST ? p->gap_x - xi : NEAREST, far = p->gap_x + xi > NEAREST ? p->gap_x + xi : NEAREST;
    double a = coil[p->radial] * far, c = coil[16 + p->radial] * near, both = near * far;
    w->x += p->sense_x * p->beta_x * (a - c) * (a + c) / (both * both);
    if (fabs(s[X]) <= p->stop) return;
    double deep = s[X] > 0 ? s[X] - p->stop : s[X] + p->stop;
    w->x -= p->ring_stiffness * deep + p->ring_damping * s[6 + X];
}

void twin_unbalance(const twin_params *p, const twin_state *st, twin_derived *d) {
    turning *t = &d->turned;
    t->sum_c = t->sum_s = t->moment_c = t->moment_s = 0;
    memset(t->modal, 0, sizeof t->modal);
    double shift = st && st->loose ? p->loose_shift : 0; /* a loose weight has slipped along its groove */
    for (int k = 0; k < p->planes; k++)
        unbalanced(t, p->unbalance[k], p->unbalance_phase[k], st ? st->weight_c[k] : 0, st ? st->weight_s[k] : 0, shift,
                   p->plane[k], p->shape_plane[2 * k], p->shape_plane[2 * k + 1]);
}

static void couple(const twin_params *p, const twin_derived *d, const double *s, wrench *w) {
    double y, z;
    twin_plane(d, s, p->coupling_at, p->shape_coupling, &y, &z);
    pushed(d->flexible, 1, w, p->coupling_at, p->shape_coupling, -p->coupling * (y - p->coupling_offset[0]),
        -p->coupling * (z - p->coupling_offset[1]));
}

/* Drive and drag act along the shaft's own axis, which cancels the terms in w' of the tilted spin momentum. What cannot move
 * takes up whatever acts on it. */
static INLINE void rates(int flexible, int blocks, const twin_params *p, const twin_derived *d, const double *s,
                         const double *coil, const double *load, double *ds) {
    wrench w = {load[0], load[1], load[2], load[3], load[4], 0, {load[5], load[6], load[7], load[8]}};
    attract(flexible, p, blocks, s, coil, &w);
    if (p->coupling > 0) couple(p, d, s, &w);
    for (int k = 0; d->near && k < p->rings; k++) touchdown(p, d, s, k, &w);
    double spin = (d->torque - p->viscous * s[11] + w.torque) * d->per_polar;
    whirl(flexible, 1, &d->turned, s, spin, &w);
    double gyro = p->polar_inertia * s[11], ay = w.y * d->per_mass + p->gravity[1], az = w.z * d->per_mass + p->gravity[2];
    memcpy(ds, s + 6, 6 * sizeof *ds);
    ds[6 + X] = 0;
    if (p->axial) {
        thrust(p, s, coil, &w);
        ds[6 + X] = w.x * d->per_mass + p->gravity[0];
    }
    ds[6 + Y] = p->free_radial[0] * ay + p->free_radial[1] * az;
    ds[6 + Z] = p->free_radial[1] * ay + p->free_radial[2] * az;
    ds[6 + PSI] = p->free_tilt * (w.psi - gyro * s[6 + THETA]) * d->per_inertia;
    ds[6 + THETA] = p->free_tilt * (w.theta + gyro * s[6 + PSI]) * d->per_inertia;
    ds[11] = spin;
    if (flexible) bend(p->mode_on, p->mode_mass, d->damp, d->square, s, w.modal, ds);
}

void twin_rates(const twin_params *p, const twin_derived *d, const double *s, const double *coil, const double *load, double *ds) {
    if (d->flexible) /* apart, so that a rigid shaft does not pay for bending, nor two planes for more */
        rates(1, d->blocks, p, d, s, coil, load, ds);
    else if (d->blocks == 1)
        rates(0, 1, p, d, s, coil, load, ds);
    else
        rates(0, d->blocks, p, d, s, coil, load, ds);
}
