/* Mechanics of the rotor. With q = (x, y, z, psi, theta), a plane at the station s is at y + s theta, z - s psi, and an axis
 * that pulls along (c, d) there at c (y + s theta) + d (z - s psi) = a' q: a force F of it is the wrench a F.
 *   m r'' = sum F + m g + unbalance,  I psi'' = M_psi - I_p w theta',  I theta'' = M_theta + I_p w psi'. */
#include <math.h>
#include <string.h>
#include "twin.h"

#define NEAREST 1e-4 /* of a gap: nearer, the iron saturates */

typedef struct {
    double x, y, z, psi, theta, torque, modal[4];
} wrench;

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

static INLINE void place(int flexible, const double *s, double station, const double *shape, double *y, double *z) {
    *y = s[Y] + station * s[THETA];
    *z = s[Z] - station * s[PSI];
    if (!flexible) return;
    *y += shape[0] * s[12] + shape[1] * s[14];
    *z += shape[0] * s[13] + shape[1] * s[15];
}

void twin_plane(const twin_derived *d, const double *s, double station, const double *shape, double *y, double *z) {
    place(d->flexible, s, station, shape, y, z);
}

static INLINE void add(int flexible, wrench *w, double station, const double *shape, double fy, double fz) {
    w->y += fy;
    w->z += fz;
    w->theta += station * fy;
    w->psi -= station * fz;
    if (!flexible) return;
    for (int k = 0; k < 2; k++) {
        w->modal[2 * k] += shape[k] * fy;
        w->modal[2 * k + 1] += shape[k] * fz;
    }
}

static void touchdown(const twin_params *p, const twin_derived *d, const double *s, int k, wrench *w) {
    double y, z, station = p->ring[k], clearance = p->clearance[k];
    const double *shape = p->shape_ring + 2 * k;
    twin_plane(d, s, station, shape, &y, &z);
    if (y * y + z * z <= clearance * clearance) return;
    double r = sqrt(y * y + z * z), ny = y / r, nz = z / r;
    double vy = s[6 + Y] + station * s[6 + THETA], vz = s[6 + Z] - station * s[6 + PSI];
    double push = p->ring_stiffness * (r - clearance) + p->ring_damping * (vy * ny + vz * nz);
    if (push <= 0) return;
    double slip = -vy * nz + vz * ny + p->ring_radius * s[11], drag = p->ring_friction * push * tanh(slip / 0.01);
    add(d->flexible, w, station, shape, -push * ny + drag * nz, -push * nz - drag * ny);
    w->torque -= drag * p->ring_radius;
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
    d->sum_c = d->sum_s = d->moment_c = d->moment_s = 0;
    memset(d->modal, 0, sizeof d->modal);
    for (int k = 0; k < p->planes; k++) {
        double c = p->unbalance[k] * cos(p->unbalance_phase[k]), s = p->unbalance[k] * sin(p->unbalance_phase[k]);
        if (st) {
            double shift = st->loose ? p->loose_shift : 0; /* a loose weight has slipped along its groove */
            c += st->weight_c[k] * cos(shift) - st->weight_s[k] * sin(shift);
            s += st->weight_s[k] * cos(shift) + st->weight_c[k] * sin(shift);
        }
        d->sum_c += c;
        d->sum_s += s;
        d->moment_c += p->plane[k] * c;
        d->moment_s += p->plane[k] * s;
        for (int m = 0; m < 2; m++) {
            d->modal[2 * m] += p->shape_plane[2 * k + m] * c;
            d->modal[2 * m + 1] += p->shape_plane[2 * k + m] * s;
        }
    }
}

void twin_at(twin_derived *d, double angle) {
    d->angle = angle;
    d->turn_c = cos(angle);
    d->turn_s = sin(angle);
}

/* cos and sin of an angle that is less than a tick away from d->angle: series while that is short, good to 1e-15 */
static INLINE void turn(const twin_derived *d, double e, double *c, double *s) {
    double q = e * e, ce = 1 - q / 2 * (1 - q / 12 * (1 - q / 30 * (1 - q / 56)));
    double se = e * (1 - q / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72))));
    if (q > 0.04) ce = cos(e), se = sin(e);
    *c = d->turn_c * ce - d->turn_s * se;
    *s = d->turn_s * ce + d->turn_c * se;
}

/* Unbalance u at the angle a: u w^2 (cos, sin)(phi + a) + u w' (sin, -cos)(phi + a): minus mass times the acceleration */
static INLINE void unbalance(int flexible, const twin_derived *d, const double *s, double spin, wrench *w) {
    double c, q, square = s[11] * s[11];
    turn(d, s[5] - d->angle, &c, &q);
    double rc = square * c + spin * q, rs = square * q - spin * c;
    w->y += d->sum_c * rc - d->sum_s * rs;
    w->z += d->sum_c * rs + d->sum_s * rc;
    w->theta += d->moment_c * rc - d->moment_s * rs;
    w->psi -= d->moment_c * rs + d->moment_s * rc;
    if (!flexible) return;
    for (int k = 0; k < 4; k += 2) {
        w->modal[k] += d->modal[k] * rc - d->modal[k + 1] * rs;
        w->modal[k + 1] += d->modal[k] * rs + d->modal[k + 1] * rc;
    }
}

static void bend(const twin_params *p, const twin_derived *d, const double *s, const double *modal, double *ds) {
    memcpy(ds + 12, s + 16, 4 * sizeof *ds);
    for (int k = 0; k < 4; k++) {
        int m = k / 2;
        ds[16 + k] = p->mode_on[m] == 0 ? 0 : modal[k] / p->mode_mass[m] - d->damp[m] * s[16 + k] - d->square[m] * s[12 + k];
    }
}

static void couple(const twin_params *p, const twin_derived *d, const double *s, wrench *w) {
    double y, z;
    twin_plane(d, s, p->coupling_at, p->shape_coupling, &y, &z);
    add(d->flexible, w, p->coupling_at, p->shape_coupling, -p->coupling * (y - p->coupling_offset[0]),
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
    unbalance(flexible, d, s, spin, &w);
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
    if (flexible) bend(p, d, s, w.modal, ds);
}

void twin_rates(const twin_params *p, const twin_derived *d, const double *s, const double *coil, const double *load, double *ds) {
    if (d->flexible) /* apart, so that a rigid shaft does not pay for bending, nor two planes for more */
        rates(1, d->blocks, p, d, s, coil, load, ds);
    else if (d->blocks == 1)
        rates(0, 1, p, d, s, coil, load, ds);
    else
        rates(0, d->blocks, p, d, s, coil, load, ds);
}
