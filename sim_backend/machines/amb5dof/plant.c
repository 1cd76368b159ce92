/* Mechanics of the AMB stand: T (2.3) with the corrected labels, (2.4b), gyroscopics, unbalance, coupling, rings, bending. */
#include <math.h>
#include <string.h>
#include "amb5dof.h"

/* T (2.4): F = beta (ip^2/(gap - xi)^2 - in^2/(gap + xi)^2); below a gap of 0.1 mm the iron saturates */
static INLINE double force(double beta, double gap, double xi, double ip, double in) {
    double near = gap - xi > 1e-4 ? gap - xi : 1e-4, far = gap + xi > 1e-4 ? gap + xi : 1e-4;
    double a = ip * far, b = in * near, both = near * far;
    return beta * (a - b) * (a + b) / (both * both);
}

void amb_unbalance(const amb_params *p, const amb_state *st, amb_derived *d) {
    turning *t = &d->turned;
    t->sum_c = t->sum_s = t->moment_c = t->moment_s = 0;
    memset(t->modal, 0, sizeof t->modal);
    double shift = st && st->loose ? p->loose_shift : 0; /* a loose weight has slipped along its groove */
    for (int b = 0; b < 2; b++)
        unbalanced(t, p->unbalance[b], p->unbalance_phase[b], st ? st->weight_c[b] : 0, st ? st->weight_s[b] : 0, shift,
                   d->unbalanced[b], p->shape_unbalance[b], p->shape_unbalance[2 + b]);
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

void amb_plane(const amb_derived *d, const double *s, double station, const double *shape, double *y, double *z) {
    placed(d->flexible, 2, s, station, shape, y, z);
}

static wrench touchdown(const amb_params *p, const amb_derived *d, const double *s, int b) {
    const ring at = {p->clearance, p->ring_stiffness, p->ring_damping, p->ring_friction, p->ring_radius};
    double y, z, fy, fz, brake, vy = s[6 + Y] + d->sensor[b] * s[6 + THETA], vz = s[6 + Z] - d->sensor[b] * s[6 + PSI];
    wrench w = {0};
    amb_plane(d, s, d->sensor[b], p->shape_sensor + b, &y, &z);
    if (!touched(&at, y, z, vy, vz, s[11], &fy, &fz, &brake)) return w;
    pushed(d->flexible, 2, &w, d->sensor[b], p->shape_sensor + b, fy, fz);
    w.torque -= brake;
    return w;
}

static INLINE void thrust(const amb_params *p, const double *s, const double *coil, wrench *w) {
    w->x += force(p->beta[4], p->gap_x, s[X], coil[8], coil[9]);
    if (fabs(s[X]) > p->stop) {
        double deep = s[X] > 0 ? s[X] - p->stop : s[X] + p->stop;
        w->x -= p->ring_stiffness * deep + p->ring_damping * s[6 + X];
    }
}

/* T (2.3). Drive and drag act along the shaft's own axis, which cancels the terms in w' of the tilted spin momentum. */
static INLINE void rates(int flexible, const amb_params *p, const amb_derived *d, const double *s, const double *coil, double *ds) {
    wrench w = {0};
    double y, z, spin;
    for (int b = 0; b < 2; b++) { /* the AMBs stand still while the shaft moves by x */
        double station = d->amb[b] - s[X];
        placed(flexible, 2, s, station, p->shape_amb + b, &y, &z);
        double fy = force(p->beta[2 * b], p->gap, y + p->offset[2 * b], coil[4 * b], coil[4 * b + 1]);
        double fz = force(p->beta[2 * b + 1], p->gap, z + p->offset[2 * b + 1], coil[4 * b + 2], coil[4 * b + 3]);
        pushed(flexible, 2, &w, station, p->shape_amb + b, fy, fz);
        if (d->near) { /* apart, so that the sum of a free shaft stays in registers */
            wrench t = touchdown(p, d, s, b);
            w.y += t.y, w.z += t.z, w.psi += t.psi, w.theta += t.theta, w.torque += t.torque;
            for (int k = 0; k < 4; k++) w.modal[k] += t.modal[k];
        }
    }
    double shape[4] = {p->shape_coupling[0], 0, p->shape_coupling[1], 0};
    placed(flexible, 2, s, -p->l_c, shape, &y, &z);
    y -= p->coupling_offset[0], z -= p->coupling_offset[1];
    pushed(flexible, 2, &w, -p->l_c, shape, -p->coupling * y, -p->coupling * z);
    thrust(p, s, coil, &w);
    spin = (d->torque - p->viscous * s[11] + w.torque) * d->per_polar;
    whirl(flexible, 0, &d->turned, s, spin, &w);
    double gyro = p->polar_inertia * s[11];
    memcpy(ds, s + 6, 6 * sizeof *ds);
    ds[6 + X] = w.x * d->per_mass;
    ds[6 + Y] = w.y * d->per_mass + p->gravity_y;
    ds[6 + Z] = w.z * d->per_mass + p->gravity_z;
    ds[6 + PSI] = (w.psi - gyro * s[6 + THETA]) * d->per_inertia;
    ds[6 + THETA] = (w.theta + gyro * s[6 + PSI]) * d->per_inertia;
    ds[11] = spin;
    if (!flexible) return;
    double modal[4] = {w.modal[0], w.modal[1], w.modal[2], w.modal[3]};
    bend(p->mode_on, p->mode_mass, d->damp, d->square, s, modal, ds);
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
    turned_to(&d.turned, s[5]);
    d.torque = torque;
    d.near = 1;
    memset(ds, 0, 20 * sizeof *ds);
    amb_rates(p, &d, s, coil, ds);
}
