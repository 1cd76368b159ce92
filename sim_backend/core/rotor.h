/* Mechanics of a rotor that turns: the wrench on it, its unbalance, what a ring and what bending do, the amplifiers of its
 * coils. Its state: x along it, y and z across, psi about y, theta about z, its angle, their rates; bending y1 z1 y2 z2, their
 * rates. A plane at the station s is at y + s theta, z - s psi. */
#ifndef ROTOR_H
#define ROTOR_H
#include <math.h>
#include <string.h>
#include "core.h"
#include "numbers.h"

typedef struct {
    double x, y, z, psi, theta, torque, modal[4];
} wrench;

/* where a plane of the shaft is: rotations by theta about z and by psi about y, and what the shaft bends: of the second mode the
 * shape lies `apart` numbers on */
static INLINE void placed(int flexible, int apart, const double *s, double station, const double *shape, double *y, double *z) {
    *y = s[1] + station * s[4];
    *z = s[2] - station * s[3];
    if (!flexible) return;
    *y += shape[0] * s[12] + shape[apart] * s[14];
    *z += shape[0] * s[13] + shape[apart] * s[15];
}

/* a force there */
static INLINE void pushed(int flexible, int apart, wrench *w, double station, const double *shape, double fy, double fz) {
    w->y += fy;
    w->z += fz;
    w->theta += station * fy;
    w->psi -= station * fz;
    if (!flexible) return;
    for (int k = 0; k < 2; k++) {
        w->modal[2 * k] += shape[apart * k] * fy;
        w->modal[2 * k + 1] += shape[apart * k] * fz;
    }
}

/* the shaft's angle with its cosine and sine, and its unbalance: forces, moments and what they do to bending, by cos and sin */
typedef struct {
    double angle, turn_c, turn_s, sum_c, sum_s, moment_c, moment_s, modal[4];
} turning;

static INLINE void turned_to(turning *d, double angle) {
    d->angle = angle;
    d->turn_c = cos(angle);
    d->turn_s = sin(angle);
}

/* An unbalance of u kg m at `phase` and what is mounted beside it (by cos and sin, and slipped by `shift`) in the plane at
 * `station`, whose bending modes are `one` and `two` there. */
static INLINE void unbalanced(turning *d, double u, double phase, double mounted_c, double mounted_s, double shift,
                              double station, double one, double two) {
    double c = u * cos(phase), s = u * sin(phase);
    c += mounted_c * cos(shift) - mounted_s * sin(shift);
    s += mounted_s * cos(shift) + mounted_c * sin(shift);
    d->sum_c += c;
    d->sum_s += s;
    d->moment_c += station * c;
    d->moment_s += station * s;
    d->modal[0] += one * c;
    d->modal[1] += one * s;
    d->modal[2] += two * c;
    d->modal[3] += two * s;
}

/* cos and sin of the angle e rad on from d->angle: two short series, good to 1e-15 for a fifth of a radian; `any`: where e may
 * be more */
static INLINE void turn_on(const turning *d, int any, double e, double *c, double *s) {
    double q = e * e, ce = 1 - q / 2 * (1 - q / 12 * (1 - q / 30 * (1 - q / 56)));
    double se = e * (1 - q / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72))));
    if (any && q > 0.04) ce = cos(e), se = sin(e);
    *c = d->turn_c * ce - d->turn_s * se;
    *s = d->turn_s * ce + d->turn_c * se;
}

/* Unbalance u at the angle a: u w^2 (cos, sin)(phi + a) + u w' (sin, -cos)(phi + a): minus mass times the acceleration */
static INLINE void whirl(int flexible, int any, const turning *d, const double *s, double spin, wrench *w) {
    double c, q, square = s[11] * s[11];
    turn_on(d, any, s[5] - d->angle, &c, &q);
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

/* bending modes, each in two directions, driven by `modal` */
static INLINE void bend(const double *on, const double *mass, const double *damp, const double *square, const double *s,
                        const double *modal, double *ds) {
    memcpy(ds + 12, s + 16, 4 * sizeof *ds);
    for (int k = 0; k < 4; k++) {
        int m = k / 2;
        ds[16 + k] = on[m] == 0 ? 0 : modal[k] / mass[m] - damp[m] * s[16 + k] - square[m] * s[12 + k];
    }
}

typedef struct {
    double clearance, stiffness, damping, friction, radius;
} ring;

/* What a ring does to the shaft whose plane is at (y, z) there and moves with (vy, vz): the force, and the torque that
 * brakes it; 0 where it does not press. */
static INLINE int touched(const ring *p, double y, double z, double vy, double vz, double spin, double *fy, double *fz,
                          double *torque) {
    if (y * y + z * z <= p->clearance * p->clearance) return 0;
    double r = sqrt(y * y + z * z), ny = y / r, nz = z / r;
    double push = p->stiffness * (r - p->clearance) + p->damping * (vy * ny + vz * nz);
    if (push <= 0) return 0;
    double slip = -vy * nz + vz * ny + p->radius * spin, drag = p->friction * push * tanh(slip / 0.01);
    *fy = -push * ny + drag * nz;
    *fz = -push * nz - drag * ny;
    *torque = drag * p->radius;
    return 1;
}

/* Coil current after `time`: u = clip(L w (ref - i) + R i, +-most), L di/dt = u - R i. At the limit it goes towards
 * u/R; where u leaves the limit, i = (L w ref - u)/(L w - R), first-order at the rate w from there. */
static INLINE double follow(double inductance, double w, double resistance, double u_max, double current, double reference,
                            double time) {
    double lw = inductance * w, rate = resistance / inductance, u = lw * (reference - current) + resistance * current;
    if (fabs(u) <= u_max) return reference + (current - reference) * exp(-w * time);
    double limit = u > 0 ? u_max : -u_max, edge = (lw * reference - limit) / (lw - resistance), end = limit / resistance;
    double ratio = (end - current) / (end - edge), left = ratio > 0 ? time - log(ratio) / rate : -1;
    if (left <= 0) return end + (current - end) * exp(-rate * time);
    return reference + (edge - reference) * exp(-w * left);
}

/* torque on the shaft at a speed, of a drive that has come to `target` and of Coulomb's drag */
static INLINE double driven(double gain, double limit, double target, double coulomb, double coulomb_speed, double speed) {
    double torque = least(most(gain * (target - speed), -limit), limit);
    if (speed != 0) torque -= coulomb * speed / sqrt(speed * speed + coulomb_speed * coulomb_speed);
    return torque;
}
#endif
