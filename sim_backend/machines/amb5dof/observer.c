/* Velocity and disturbance observers of the flatness laws. 1: constant and synchronous disturbance inside one observer of
 * the motion, its gains by pole placement on the sampled model. 2: T (3.6) with (3.13), as printed. */
#include <complex.h>
#include <math.h>
#include <string.h>
#include "amb5dof.h"

enum { NONE, INSIDE, LITERAL };
enum { CONSTANT = 1, HARMONIC = 2 };
static const int coordinate[4] = {Y, Z, PSI, THETA};

static double square(double complex z) { return creal(z) * creal(z) + cimag(z) * cimag(z); }

/* Gain and angle by which a synchronous command must lead so that the current comes out right: the inverse of
 * e^(-jwT) (1 - e^(-jwT))/(jwT) 1/(1 + jw/rate): one sample of delay, zero-order hold, current loop. */
static void lead(const amb_control *c, amb_observer *o) {
    double complex jw = I * o->speed, z = cexp(-jw * TICK);
    double complex inverse = jw * TICK / (z * (1 - z)) * (1 + jw / c->model_rate);
    o->lead_c = creal(inverse);
    o->lead_s = cimag(inverse);
}

/* Gains for the poles exp(p T): p = -constant; -(damping +- j turning) w; -(1 +- j) velocity. With w = z - 1,
 * q = z^2 - 2 z cos(wT) + 1 and P the product of (z - z_k), P = w^3 q + N3 q + N2 w^3: N2 follows from P at the roots of
 * q, N3 from P at w = 0. N3 belongs to the chain of three integrators, N2 to the oscillator. */
void amb_observer_gains(const amb_control *c, amb_observer *o, double speed) {
    const double t = TICK;
    o->speed = speed;
    o->turning = speed > c->observer_speed;
    double complex z1 = exp(-c->observer_constant * t), zv = cexp(-(1 + I) * c->observer_velocity * t);
    double complex zh = cexp((-c->observer_damping + I * c->observer_turning) * speed * t), z = cexp(I * speed * t);
    double e = 1 - creal(z1), vb = 2 * (1 - creal(zv)), vc = square(1 - zv), hb = 2 * (1 - creal(zh)), hc = square(1 - zh);
    double p0 = e * vc, p1 = vc + e * vb, p2 = vb + e, l[5] = {0};
    if (o->turning) {
        double q = 2 * (1 - creal(z)), r0 = p0 * hc, r1 = p1 * hc + p0 * hb, r2 = p2 * hc + p1 * hb + p0;
        p0 = r0 / q;
        p1 = (r1 - p0 * q) / q;
        p2 = (r2 - p0 - p1 * q) / q;
        double complex w = z - 1, p = (z - z1) * (z - zv) * (z - conj(zv)) * (z - zh) * (z - conj(zh)) / (w * w * w);
        l[3] = cimag(p) / cimag(z);
        l[4] = creal(p) / cimag(z);
    }
    l[0] = p2, l[1] = (p1 - p0 / 2) / t, l[2] = p0 / (t * t);
    o->turn_c = creal(z), o->turn_s = cimag(z);
    o->gain[0] = l[0] - t * l[1] + t * t / 2 * l[2]; /* the correction comes after the step: gains by the step's inverse */
    o->gain[1] = l[1] - t * l[2];
    o->gain[2] = l[2];
    o->gain[3] = o->turn_c * l[3] - o->turn_s * l[4];
    o->gain[4] = o->turn_s * l[3] + o->turn_c * l[4];
    lead(c, o);
}

/* T (3.1) without disturbances: accelerations of y, z, psi, theta by the model's forces of the given coil currents */
static void accelerations(const amb_control *c, const double *q, const double *coil, const double *rate, double speed,
                          double *a) {
    double f[4], in = c->model_l_ia + q[X], out = c->model_l_oa - q[X], gyro = c->model_polar * speed;
    double cy = -c->model_coupling * (q[Y] - c->model_l_c * q[THETA]);
    double cz = -c->model_coupling * (q[Z] + c->model_l_c * q[PSI]);
    amb_forces(c, q, coil, f);
    a[0] = (f[0] + f[2] + cy) / c->model_mass + c->model_gravity_y;
    a[1] = (f[1] + f[3] + cz) / c->model_mass + c->model_gravity_z;
    a[2] = (in * f[1] - out * f[3] + c->model_l_c * cz - gyro * rate[3]) / c->model_inertia;
    a[3] = (out * f[2] - in * f[0] - c->model_l_c * cy + gyro * rate[2]) / c->model_inertia;
}

static void start(amb_law_state *l, const double *q, const double *a) {
    amb_observer *o = &l->observer;
    memset(o->x, 0, sizeof o->x);
    for (int k = 0; k < 4; k++) {
        o->x[k][0] = q[coordinate[k]];
        o->input[k] = a[k];
    }
    o->started = 1;
}

static void inside(const amb_control *c, amb_law_state *l, const double *q, const double *a, double *rate, double *against,
                   double *wave, double *ahead) {
    amb_observer *o = &l->observer;
    const double t = TICK, *g = o->gain;
    int bits = (int)c->compensate;
    for (int k = 0; k < 4; k++) {
        double *x = o->x[k], from = o->input[k], s = x[3];
        x[0] += t * x[1] + t * t * ((2 * from + a[k]) / 6 + x[2] / 2);
        x[1] += t * ((from + a[k]) / 2 + x[2]);
        x[3] = o->turn_c * s + o->turn_s * x[4];
        x[4] = o->turn_c * x[4] - o->turn_s * s;
        if (!o->turning) x[3] = x[4] = 0;
        double error = q[coordinate[k]] - x[0] - x[3];
        for (int n = 0; n < 5; n++) x[n] += g[n] * error;
        rate[coordinate[k]] = x[1] + o->speed * x[4];
        o->input[k] = a[k];
        if (bits & CONSTANT) against[coordinate[k]] += x[2];
        if (bits & HARMONIC && o->turning) {
            double square = o->speed * o->speed;
            wave[coordinate[k]] = -square * x[3];
            ahead[coordinate[k]] = -square * (x[3] * o->lead_c + x[4] * o->lead_s);
        }
    }
}

/* T (3.6), poles -3500 and -4500, and (3.13) per unit of mass, by the midpoint rule in half ticks; without actuator lag */
static void literal_rates(const double *x, const double *h, double w, double q, double a, double *dx) {
    double constant = x[2] + h[0] * x[1], wave = x[3] + h[1] * x[1], sum = a + constant + wave;
    dx[0] = x[1] + 8000 * (q - x[0]);
    dx[1] = a + 15.75e6 * (q - x[0]);
    dx[2] = -h[0] * sum;
    dx[3] = x[4] + h[2] * x[1] - h[1] * sum;
    dx[4] = -w * w * wave - h[2] * sum;
}

static void literal(const amb_control *c, amb_law_state *l, const double *q, const double *a, double speed, double *rate,
                    double *against) {
    amb_observer *o = &l->observer;
    double w = speed, re = c->observer_damping * w, im = c->observer_turning * w, p = c->observer_constant;
    double h[3] = {p, 0, 0}, dx[5], mid[5], half = TICK / 2;
    int bits = (int)c->compensate;
    o->turning = w > c->observer_speed;
    if (o->turning) {
        h[0] = p * (re * re + im * im) / (w * w);
        h[1] = p + 2 * re - h[0];
        h[2] = re * re + im * im + 2 * re * p - w * w;
    }
    for (int k = 0; k < 4; k++) {
        double *x = o->x[k];
        for (int n = 0; n < 2; n++) {
            literal_rates(x, h, w, q[coordinate[k]], a[k], dx);
            for (int i = 0; i < 5; i++) mid[i] = x[i] + half / 2 * dx[i];
            literal_rates(mid, h, w, q[coordinate[k]], a[k], dx);
            for (int i = 0; i < 5; i++) x[i] += half * dx[i];
        }
        if (!o->turning) x[3] = x[4] = 0;
        rate[coordinate[k]] = x[1];
        if (bits & CONSTANT) against[coordinate[k]] += x[2] + h[0] * x[1];
        if (bits & HARMONIC && o->turning) against[coordinate[k]] += x[3] + h[1] * x[1];
    }
}

/* Rates and disturbing accelerations of the coordinates y, z, psi, theta, their synchronous part as it is and as it must be
 * commanded because of the actuators; gains are made again when the speed has changed
 * by 2e-4 of itself, or a pole has. */
void amb_observe(const amb_control *c, amb_law_state *l, const double *q, double speed, double *rate, double *against,
                 double *wave, double *ahead) {
    amb_observer *o = &l->observer;
    const double made[5] = {c->observer, c->observer_constant, c->observer_damping, c->observer_turning, c->observer_velocity};
    double keep = exp(-c->model_rate * TICK), a[4], before[4];
    int changed = memcmp(made, o->made, sizeof made) != 0, fresh = !o->started || made[0] != o->made[0];
    if (fresh) { /* the other observer's states mean something else */
        memcpy(l->coil, l->sent, sizeof l->coil);
        memset(o->x, 0, sizeof o->x);
    }
    for (int k = 0; k < 10; k++) l->coil[k] = l->sent[k] + (l->coil[k] - l->sent[k]) * keep;
    int printed = (int)c->observer == LITERAL;
    for (int k = 0; k < 4; k++) before[k] = o->x[k][1] + (printed ? 0 : o->speed * o->x[k][4]);
    accelerations(c, q, printed ? l->waiting : l->coil, before, speed, a);
    if (fresh) start(l, q, a);
    if (printed) {
        literal(c, l, q, a, speed, rate, against);
    } else {
        if (changed || fabs(speed - o->speed) > 2e-4 * o->speed) amb_observer_gains(c, o, speed);
        inside(c, l, q, a, rate, against, wave, ahead);
    }
    memcpy(o->made, made, sizeof made);
}
