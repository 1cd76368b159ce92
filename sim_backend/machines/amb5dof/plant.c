/* Mechanics of the AMB stand: T (2.3) with the corrected labels, (2.4b), gyroscopics, unbalance, coupling, rings, bending. */
#include <math.h>
#include <string.h>
#include "amb5dof.h"

#define INLINE inline __attribute__((always_inline))

/* T (2.4): F = beta (ip^2/(gap - xi)^2 - in^2/(gap + xi)^2); below a gap of 0.1 mm the iron saturates */
static INLINE double force(double beta, double gap, double xi, double ip, double in) {
    double near = gap - xi > 1e-4 ? gap - xi : 1e-4, far = gap + xi > 1e-4 ? gap + xi : 1e-4;
    double a = ip * far, b = in * near, both = near * far;
    return beta * (a - b) * (a + b) / (both * both);
}

void amb_unbalance(const amb_params *p, const amb_state *st, amb_derived *d) {
    d->sum_c = d->sum_s = d->moment_c = d->moment_s = 0;
    memset(d->modal, 0, sizeof d->modal);
    for (int b = 0; b < 2; b++) {
        double c = p->unbalance[b] * cos(p->unbalance_phase[b]), s = p->unbalance[b] * sin(p->unbalance_phase[b]);
        if (st) {
            double shift = st->loose ? p->loose_shift : 0; /* a loose weight has slipped along its groove */
            c += st->weight_c[b] * cos(shift) - st->weight_s[b] * sin(shift);
            s += st->weight_s[b] * cos(shift) + st->weight_c[b] * sin(shift);
        }
        d->sum_c += c;
        d->sum_s += s;
        d->moment_c += d->unbalanced[b] * c;
        d->moment_s += d->unbalanced[b] * s;
        for (int k = 0; k < 2; k++) {
            d->modal[2 * k] += p->shape_unbalance[2 * k + b] * c;
            d->modal[2 * k + 1] += p->shape_unbalance[2 * k + b] * s;
        }
    }
}

void amb_derive(const amb_params *p, int substeps, amb_derived *d) {
    memset(d, 0, sizeof *d);
    d->amb[0] = -p->l_ia, d->amb[1] = p->l_oa;
    d->sensor[0] = -p->l_is, d->sensor[1] = p->l_os;
    d->unbalanced[0] = -p->l_iu, d->unbalanced[1] = p->l_ou;
    d->per_mass = 1 / p->mass;
    d->per_inertia = 1 / p->inertia;
    d->per_polar = 1 / p->polar_inertia;
    d->per_position_lsb = p->position_lsb > 0 ? 1 / p->position_lsb : 0;
    d->per_current_lsb = p->current_lsb > 0 ? 1 / p->current_lsb : 0;
    for (int k = 0; k < 10; k++) d->per_gain[k] = 1 / p->current_gain[k];
    for (int k = 0; k < 16; k++) {
        d->runout_c[k] = p->runout[k] * cos(p->runout_phase[k]);
        d->runout_s[k] = p->runout[k] * sin(p->runout_phase[k]);
        d->runs_out |= p->runout[k] != 0;
    }
    d->flexible = p->mode_on[0] != 0 || p->mode_on[1] != 0;
    for (int k = 0; k < 2; k++) {
        double w = TWO_PI * p->mode_hz[k];
        d->square[k] = w * w;
        d->damp[k] = 2 * p->mode_damping[k] * w;
    }
    d->steps[0] = substeps;
    d->steps[1] = substeps > 5 ? substeps : 5;
    d->steps[2] = substeps > 10 ? substeps : 10;
    for (int k = 0; k < 3; k++) d->keep[k] = exp(-p->amplifier_rate * TICK / d->steps[k] / 2);
}

void amb_at(amb_derived *d, double angle) {
    d->angle = angle;
    d->turn_c = cos(angle);
    d->turn_s = sin(angle);
}

/* cos and sin of an angle that is less than a tick away from d->angle: two short series, good to 1e-15 at 1600 rad/s */
static INLINE void turn(const amb_derived *d, double e, double *c, double *s) {
    double q = e * e;
    double ce = 1 - q / 2 * (1 - q / 12 * (1 - q / 30 * (1 - q / 56)));
    double se = e * (1 - q / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72))));
    *c = d->turn_c * ce - d->turn_s * se;
    *s = d->turn_s * ce + d->turn_c * se;
}

/* where a station of the shaft is: rotations by theta about z and by psi about y, and what the shaft bends */
static INLINE void place(int flexible, const double *s, double station, const double *shape, double *y, double *z) {
    *y = s[Y] + station * s[THETA];
    *z = s[Z] - station * s[PSI];
    if (!flexible) return;
    *y += shape[0] * s[12] + shape[2] * s[14];
    *z += shape[0] * s[13] + shape[2] * s[15];
}

void amb_plane(const amb_derived *d, const double *s, double station, const double *shape, double *y, double *z) {
    place(d->flexible, s, station, shape, y, z);
}

typedef struct {
    double fx, fy, fz, psi, theta, torque, modal[4];
} wrench;

static INLINE void add(int flexible, wrench *w, double station, const double *shape, double fy, double fz) {
    w->fy += fy;
    w->fz += fz;
    w->theta += station * fy;
    w->psi -= station * fz;
    if (!flexible) return;
    for (int k = 0; k < 2; k++) {
        w->modal[2 * k] += shape[2 * k] * fy;
        w->modal[2 * k + 1] += shape[2 * k] * fz;
    }
}

static wrench touchdown(const amb_params *p, const amb_derived *d, const double *s, int b) {
    double y, z, vy, vz;
    wrench w = {0};
    amb_plane(d, s, d->sensor[b], p->shape_sensor + b, &y, &z);
    if (y * y + z * z <= p->clearance * p->clearance) return w;
    double r = sqrt(y * y + z * z), ny = y / r, nz = z / r;
    vy = s[6 + Y] + d->sensor[b] * s[6 + THETA];
    vz = s[6 + Z] - d->sensor[b] * s[6 + PSI];
    double push = p->ring_stiffness * (r - p->clearance) + p->ring_damping * (vy * ny + vz * nz);
    if (push <= 0) return w;
    double slip = -vy * nz + vz * ny + p->ring_radius * s[11], drag = p->ring_friction * push * tanh(slip / 0.01);
    add(d->flexible, &w, d->sensor[b], p->shape_sensor + b, -push * ny + drag * nz, -push * nz - drag * ny);
    w.torque -= drag * p->ring_radius;
    return w;
}

static INLINE void thrust(const amb_params *p, const double *s, const double *coil, wrench *w) {
    w->fx += force(p->beta[4], p->gap_x, s[X], coil[8], coil[9]);
    if (fabs(s[X]) > p->stop) {
        double deep = s[X] > 0 ? s[X] - p->stop : s[X] + p->stop;
        w->fx -= p->ring_stiffness * deep + p->ring_damping * s[6 + X];
    }
}

/* Unbalance u at the angle a: u w^2 (cos, sin)(phi + a) + u w' (sin, -cos)(phi + a): minus mass times the acceleration */
static INLINE void unbalance(int flexible, const amb_derived *d, const double *s, double spin, wrench *w) {
    double c, q, square = s[11] * s[11];
    turn(d, s[5] - d->angle, &c, &q);
    double rc = square * c + spin * q, rs = square * q - spin * c;
    w->fy += d->sum_c * rc - d->sum_s * rs;
    w->fz += d->sum_c * rs + d->sum_s * rc;
    w->theta += d->moment_c * rc - d->moment_s * rs;
    w->psi -= d->moment_c * rs + d->moment_s * rc;
    if (!flexible) return;
    for (int k = 0; k < 4; k += 2) {
        w->modal[k] += d->modal[k] * rc - d->modal[k + 1] * rs;
        w->modal[k + 1] += d->modal[k] * rs + d->modal[k + 1] * rc;
    }
}

static void bending(const amb_params *p, const amb_derived *d, const double *s, const double *modal, double *ds) {
    memcpy(ds + 12, s + 16, 4 * sizeof *ds);
    for (int k = 0; k < 4; k++) {
        int m = k / 2;
        ds[16 + k] = p->mode_on[m] == 0 ? 0 : modal[k] / p->mode_mass[m] - d->damp[m] * s[16 + k] - d->square[m] * s[12 + k];
    }
}

/* T (2.3). Drive and drag act along the shaft's own axis, which cancels the terms in w' of the tilted spin momentum. */
static INLINE void rates(int flexible, const amb_params *p, const amb_derived *d, const double *s, const double *coil, double *ds) {
    wrench w = {0};
    double y, z, spin;
    for (int b = 0; b < 2; b++) { /* the AMBs stand still while the shaft moves by x */
        double station = d->amb[b] - s[X];
        place(flexible, s, station, p->shape_amb + b, &y, &z);
        double fy = force(p->beta[2 * b], p->gap, y + p->offset[2 * b], coil[4 * b], coil[4 * b + 1]);
        double fz = force(p->beta[2 * b + 1], p->gap, z + p->offset[2 * b + 1], coil[4 * b + 2], coil[4 * b + 3]);
        add(flexible, &w, station, p->shape_amb + b, fy, fz);
        if (d->near) { /* apart, so that the sum of a free shaft stays in registers */
            wrench t = touchdown(p, d, s, b);
            w.fy += t.fy, w.fz += t.fz, w.psi += t.psi, w.theta += t.theta, w.torque += t.torque;
            for (int k = 0; k < 4; k++) w.modal[k] += t.modal[k];
        }
    }
    double shape[4] = {p->shape_coupling[0], 0, p->shape_coupling[1], 0};
    place(flexible, s, -p->l_c, shape, &y, &z);
    y -= p->coupling_offset[0], z -= p->coupling_offset[1];
    add(flexible, &w, -p->l_c, shape, -p->coupling * y, -p->coupling * z);
    thrust(p, s, coil, &w);
    spin = (d->torque - p->viscous * s[11] + w.torque) * d->per_polar;
    unbalance(flexible, d, s, spin, &w);
    double gyro = p->polar_inertia * s[11];
    memcpy(ds, s + 6, 6 * sizeof *ds);
    ds[6 + X] = w.fx * d->per_mass;
    ds[6 + Y] = w.fy * d->per_mass + p->gravity_y;
    ds[6 + Z] = w.fz * d->per_mass + p->gravity_z;
    ds[6 + PSI] = (w.psi - gyro * s[6 + THETA]) * d->per_inertia;
    ds[6 + THETA] = (w.theta + gyro * s[6 + PSI]) * d->per_inertia;
    ds[11] = spin;
    if (!flexible) return;
    double modal[4] = {w.modal[0], w.modal[1], w.modal[2], w.modal[3]};
    bending(p, d, s, modal, ds);
}

void amb_rates(const amb_params *p, const amb_derived *d, const double *s, const double *coil, double *ds) {
    if (d->flexible) /* twice, so that a rigid shaft does not pay for bending */
        rates(1, p, d, s, coil, ds);
    else
        rates(0, p, d, s, coil, ds);
}

/* For tests: the right-hand side with `torque` N m of drive and Coulomb drag on the shaft. */
void amb_derivative(const amb_params *p, const double *s, const double *coil, double torque, double *ds) {
    amb_derived d;
    amb_derive(p, 2, &d);
    amb_unbalance(p, 0, &d);
    amb_at(&d, s[5]);
    d.torque = torque;
    d.near = 1;
    memset(ds, 0, 20 * sizeof *ds);
    amb_rates(p, &d, s, coil, ds);
}
