/* Mechanics and forces: T (6.6) with (6.5) and (2.4), plus gyroscopics, unbalance, runout, touchdown and the hung mass. */
/* of the four segments what acts, each q + j d: X = (s4 - s2)/2, Y = (s1 - s3)/2, and the means of each pair */
enum { XQ, YQ, VQ, HQ, XD, YD, VD, HD };
#include <math.h>
#include <string.h>
#include "tsbs.h"

/* From cos and sin of an angle those of one that is e further, less than a tick: two short series, good to 1e-15 at
 * 200 rad/s, and for M times the angle at 80 rad/s. */
static void turn(double c0, double s0, double e, double *c, double *s) {
    double q = e * e;
    /* by factors, for a division costs as much as ten of them */
    double ce = 1 - q * (1.0 / 2) * (1 - q * (1.0 / 12) * (1 - q * (1.0 / 30)));
    double se = e * (1 - q * (1.0 / 6) * (1 - q * (1.0 / 20) * (1 - q * (1.0 / 42))));
    *c = c0 * ce - s0 * se;
    *s = s0 * ce + c0 * se;
}

/* cos and sin of n times an angle, n whole, from its own by squaring */
static void times(double n, double c, double s, double *nc, double *ns) {
    double re = 1, im = 0;
    for (int left = (int)n; left > 0; left /= 2) {
        double a = re * c - im * s, b = re * s + im * c, square = c * c - s * s;
        if (left % 2) re = a, im = b;
        s = 2 * c * s;
        c = square;
    }
    *nc = re;
    *ns = im;
}

void tsbs_turn(double angle, double *c, double *s) {
    c[0] = cos(angle);
    s[0] = sin(angle);
    for (int n = 1; n < 4; n++) {
        c[n] = c[n - 1] * c[0] - s[n - 1] * s[0];
        s[n] = s[n - 1] * c[0] + c[n - 1] * s[0];
    }
}

/* sum a_n cos(n angle + p_n), n = 1..4, and with sin for the quadrature axis; c_n = a_n cos p_n, s_n = a_n sin p_n */
double tsbs_harmonics(const double *c, const double *s, const double *tc, const double *ts, double *quadrature) {
    double x = 0, y = 0;
    for (int n = 0; n < 4; n++) {
        x += c[n] * tc[n] - s[n] * ts[n];
        y += c[n] * ts[n] + s[n] * tc[n];
    }
    *quadrature = y;
    return x;
}

/* The angle at the start of a tick, and the runout about it as cubics: 1e-14 m at 75 rad/s for what they leave out.
 * With C, S the two components of order n, d/d(angle) takes C to -n S and S to n C. */
void tsbs_at(tsbs_derived *d, double angle, double *tc, double *ts) {
    tsbs_turn(angle, tc, ts);
    d->angle = angle;
    d->turn_c = tc[0];
    d->turn_s = ts[0];
    times(d->pole_pairs, tc[0], ts[0], &d->pole_c, &d->pole_s);
    for (int b = 0; b < 2; b++) {
        double x0 = 0, x1 = 0, x2 = 0, x3 = 0, y0 = 0, y1 = 0, y2 = 0, y3 = 0;
        for (int k = 0; k < 4; k++) {
            double n = k + 1, a = d->runout_c[4 * b + k], q = d->runout_s[4 * b + k];
            double c = a * tc[k] - q * ts[k], s = a * ts[k] + q * tc[k];
            x0 += c;
            y0 += s;
            x1 -= n * s;
            y1 += n * c;
            x2 -= n * n / 2 * c;
            y2 -= n * n / 2 * s;
            x3 += n * n * n / 6 * s;
            y3 -= n * n * n / 6 * c;
        }
        int x = 2 * b, y = 2 * b + 1;
        d->runout[0][x] = x0, d->runout[1][x] = x1, d->runout[2][x] = x2, d->runout[3][x] = x3;
        d->runout[0][y] = y0, d->runout[1][y] = y1, d->runout[2][y] = y2, d->runout[3][y] = y3;
    }
}

/* From the frame in which the law has its currents to the stator's: by M (theta + gamma + ahead), as its encoder tells the
 * angle, less the commutation's own zero. An encoder that counts backwards puts the currents at minus the rotor's angle. */
void tsbs_commutate(const tsbs_params *p, tsbs_derived *d, tsbs_reference *r) {
    double by = r->gamma + r->ahead - p->gamma_zero, pole_s = p->encoder_sign < 0 ? -d->pole_s : d->pole_s;
    if (by != d->field) {
        d->field = by;
        d->field_c = cos(p->pole_pairs * by);
        d->field_s = sin(p->pole_pairs * by);
    }
    r->turn_c = d->pole_c * d->field_c - pole_s * d->field_s;
    r->turn_s = pole_s * d->field_c + d->pole_c * d->field_s;
}

/* What holds over a tick. Lever: its weight, its moment, how far it has slipped, and the inertia added to the shaft's.
 * The bearings' share of the drag is eddy currents: it goes with the square of each axis' flux. */
void tsbs_hold(const tsbs_params *p, const double *coil, const double *lever, tsbs_derived *d) {
    double square = 0;
    for (int a = 0; a < 4; a++) square += (coil[2 * a] + coil[2 * a + 1]) * (coil[2 * a] + coil[2 * a + 1]);
    d->viscous = p->viscous * (1 - p->drag_share + p->drag_share * square / (4 * 4 * 9));
    d->coulomb = p->coulomb + (d->drive_gain > 0 ? 0 : p->brake);
    d->lever_weight = lever[0];
    if (lever[1] != 0) {
        d->lever_c = lever[1] * cos(lever[2]);
        d->lever_s = lever[1] * sin(lever[2]);
    } else {
        d->lever_c = d->lever_s = 0;
    }
    if (p->polar_inertia + lever[3] != d->polar_inertia) {
        d->polar_inertia = p->polar_inertia + lever[3];
        d->per_polar = 1 / d->polar_inertia;
    }
}

void tsbs_derive(const tsbs_params *p, double step, tsbs_derived *d) {
    for (int n = 0; n < 8; n++) {
        d->runout_c[n] = p->runout[n] * cos(p->runout_phase[n]);
        d->runout_s[n] = p->runout[n] * sin(p->runout_phase[n]);
        d->target_c[n] = p->target[n] * cos(p->target_phase[n]);
        d->target_s[n] = p->target[n] * sin(p->target_phase[n]);
    }
    for (int a = 0; a < 4; a++) {
        int b = a / 2, vertical = a % 2;
        d->axis_beta[a] = vertical ? p->beta[b] : p->beta[b] * (1 + p->asymmetry[b]);
        d->axis_gap[a] = p->gap[b];
        d->axis_z[a] = p->z_amb[b];
        d->axis_offset[a] = vertical ? p->offset_y[b] : p->offset_x[b];
    }
    d->unbalance = p->mass * p->eccentricity;
    d->per_mass = 1 / p->mass;
    d->per_inertia = 1 / p->inertia;
    d->per_coulomb_speed = 1 / p->coulomb_speed;
    d->polar_inertia = d->per_polar = 0;
    d->detent_c = cos(p->detent_phase);
    d->detent_s = sin(p->detent_phase);
    d->per_position_lsb = p->position_lsb > 0 ? 1 / p->position_lsb : 0;
    d->per_current_lsb = p->current_lsb > 0 ? 1 / p->current_lsb : 0;
    for (int k = 0; k < 10; k++) d->per_gain[k] = 1 / p->current_gain[k];
    for (int k = 0; k < 4; k++) d->per_sense[k] = 1 / p->segment_sense[k];
    d->tilt_c = cos(p->tilt);
    d->tilt_s = sin(p->tilt);
    d->gravity_x = p->gravity * d->tilt_s;
    d->gravity_y = p->gravity * -d->tilt_c;
    d->unbalance_c = cos(p->eccentricity_phase);
    d->unbalance_s = sin(p->eccentricity_phase);
    d->coil_keep = exp(-p->amplifier_rate * step / 2);
    d->segment_keep = exp(-p->segment_rate * step / 2);
    d->segment_tick = exp(-p->segment_rate * TICK);
    d->speed_keep = exp(-6.283185307179586 * 20 * TICK);
    d->drive_gain = d->drive_limit = d->drive_speed = 0;
    d->pole_pairs = p->pole_pairs;
    d->field = NAN;
}

/* T (2.4): F = beta (ip^2/(gap - xi)^2 - in^2/(gap + xi)^2); below a gap of 0.2 mm the iron saturates */
static inline double amb_force(double beta, double gap, double xi, double ip, double in) {
    double near = gap - xi > 2e-4 ? gap - xi : 2e-4, far = gap + xi > 2e-4 ? gap + xi : 2e-4;
    double a = ip * far, b = in * near, both = near * far; /* on one denominator: a division costs more than the rest */
    return beta * (a - b) * (a + b) / (both * both);
}

double tsbs_amb_force(double beta, double gap, double xi, double ip, double in) {
    return amb_force(beta, gap, xi, ip, in);
}

/* the radial AMBs' forces on the axes xi, yi, xo, yo, at e from the angle of the tick's start */
static void radial(const tsbs_derived *d, const double *s, double e, const double *coil, const double *play, double *force) {
    const double at[4] = {s[0], s[1], s[0], s[1]}, slope[4] = {s[4], -s[3], s[4], -s[3]};
    for (int a = 0; a < 4; a++) {
        double runout = d->runout[0][a] + e * (d->runout[1][a] + e * (d->runout[2][a] + e * d->runout[3][a]));
        double xi = at[a] + d->axis_z[a] * slope[a] + d->axis_offset[a] + runout;
        force[a] = amb_force(d->axis_beta[a], d->axis_gap[a], xi, coil[2 * a] - play[a], coil[2 * a + 1] + play[a]);
    }
}

typedef struct {
    double fx, fy, fz, mphi, mpsi, torque;
} wrench;

static void add(wrench *w, double z, double fx, double fy) {
    w->fx += fx;
    w->fy += fy;
    w->mphi -= z * fy; /* T (6.6d): J phi'' = l_ia F_i - l_oa F_o - l_m F_m */
    w->mpsi += z * fx; /* T (6.6e) */
}

static void touchdown(const tsbs_params *p, const double *s, int b, wrench *w) {
    double z = p->z_sensor[b];
    double x = s[0] + z * s[4] - p->ring_x[b], y = s[1] - z * s[3] - p->ring_y[b];
    if (x * x + y * y <= p->clearance * p->clearance) return;
    double r = sqrt(x * x + y * y);
    double vx = s[6] + z * s[10], vy = s[7] - z * s[9];
    double nx = x / r, ny = y / r;
    double push = p->ring_stiffness * (r - p->clearance) + p->ring_damping * (vx * nx + vy * ny);
    if (push <= 0) return;
    double slip = -vx * ny + vy * nx + p->ring_radius * s[11];
    double drag = p->ring_friction * push * tanh(slip / 0.01);
    add(w, z, -push * nx + drag * ny, -push * ny - drag * nx);
    w->torque -= drag * p->ring_radius;
}

/* what acts of the four segments' currents in the stator's frame: X, Y and the means of segments 1, 3 and of 2, 4 */
void tsbs_mix(const tsbs_params *p, const double *segment, double *mixed) {
    int wrong = p->exchange_segments != 0, first = wrong && p->phases != 6, other = wrong && p->phases == 6 ? 2 : 0;
    const double *g = p->segment_gain; /* of six phases two pairs can be exchanged, of twelve segments 1 and 2 */
    for (int k = 0; k < 8; k += 4) {
        double s1 = segment[k + first + other] * g[0], s2 = segment[k + !first + other] * g[1];
        double s3 = segment[k + 2 - other] * g[2], s4 = segment[k + 3 - other] * g[3];
        mixed[k] = (s4 - s2) / 2;
        mixed[k + 1] = (s1 - s3) / 2;
        mixed[k + 2] = (s1 + s3) / 2;
        mixed[k + 3] = (s2 + s4) / 2;
    }
}

/* T (6.5) for currents of any phase, and from T (5.25) the ripple with P theta, the pull by the torque current and the side
 * pull. In the rotor's frame, s = S exp(-j M theta), segment k has q_k + j d_k. T (6.1) has sin u sin(u - M gamma) under its
 * integral, u = M (Phi - theta), half of cos(M gamma) - cos(P Phi - (P theta + M gamma)): with q = i cos M gamma and
 * d = i sin M gamma the direct force goes with q and the cross force with d, and since it is linear in the current so for any
 * q and d. Ripple: i cos(P theta + M gamma) is q cos P theta - d sin P theta. Side pull: a segment pulls with the square of its
 * current, (alpha_6/4) (|s1|^2 - |s3|^2) = alpha_6 Re(Y conj V), V the mean of 1 and 3; T has its i_y i_theta.
 * Coulomb friction is smoothed by x / sqrt(1 + x^2) about standstill. */
static void motor(const tsbs_params *p, const tsbs_derived *d, const double *s, const double *m, double e, wrench *w) {
    double c, q;
    turn(d->pole_c, d->pole_s, d->pole_pairs * e, &c, &q);
    double xq = m[XQ] * c + m[XD] * q, xd = m[XD] * c - m[XQ] * q, yq = m[YQ] * c + m[YD] * q, yd = m[YD] * c - m[YQ] * q;
    double re = (m[VQ] + m[HQ]) / 2, im = (m[VD] + m[HD]) / 2, mean = re * c + im * q, mean_d = im * c - re * q;
    double pull_x = p->alpha_6 * (m[YQ] * m[VQ] + m[YD] * m[VD]), pull_y = p->alpha_6 * (m[XQ] * m[HQ] + m[XD] * m[HD]);
    double c2 = 2 * c * c - 1, s2 = 2 * c * q, c6 = c2 * (4 * c2 * c2 - 3), s6 = s2 * (3 - 4 * s2 * s2);
    double slow = s[11] * d->per_coulomb_speed;
    double x = s[0] + p->z_motor * s[4] + p->motor_x, y = s[1] - p->z_motor * s[3] + p->motor_y;
    double across = p->alpha_4 * mean, a2 = p->alpha_2, a3 = p->alpha_3;
    double fx = p->alpha_d * xq - p->alpha_c * yd - a2 * (xq * c2 - xd * s2) - a3 * (yq * s2 + yd * c2);
    double fy = p->alpha_d * yq + p->alpha_c * xd - a2 * (yq * c2 - yd * s2) + a3 * (xq * s2 + xd * c2);
    add(w, p->z_motor, fx - across * y + p->alpha_x * x + pull_x, fy + across * x + p->alpha_x * y - pull_y);
    w->torque += p->alpha_tau * mean + p->beta_4 * (mean * c6 - mean_d * s6) + p->beta_2 * (x * yq - y * xq) -
                 d->viscous * s[11] - d->coulomb * slow / sqrt(1 + slow * slow) -
                 p->detent * (s2 * d->detent_c + c2 * d->detent_s);
}

void tsbs_rates(const tsbs_params *p, const tsbs_derived *d, const double *s, const double *coil,
                const double *mixed, const double *play, double hung_mass, double weight, double *ds) {
    wrench w = {0};
    double tc, ts, e = s[5] - d->angle, force[4];
    turn(d->turn_c, d->turn_s, e, &tc, &ts);
    radial(d, s, e, coil, play, force);
    for (int b = 0; b < 2; b++) {
        add(&w, p->z_amb[b], force[2 * b], force[2 * b + 1]);
        if (d->near) touchdown(p, s, b, &w);
    }
    w.fz = amb_force(p->beta_z, p->gap_z, s[2], coil[8], coil[9]);
    motor(p, d, s, mixed, e, &w);
    if (d->drive_gain > 0) {
        double torque = d->drive_gain * (d->drive_speed - s[11]), limit = d->drive_limit;
        w.torque += torque > limit ? limit : torque < -limit ? -limit : torque;
    }
    double sx = d->tilt_s, sy = -d->tilt_c;
    double rate = 0;
    if (d->lever_weight != 0) {
        add(&w, p->z_lever, d->lever_weight * sx, d->lever_weight * sy);
        w.torque += d->lever_c * tc - d->lever_s * ts;
    }
    if (hung_mass > 0) { /* strap: one vertical degree of freedom */
        double hook = s[1] - p->z_hook * s[3], hook_rate = s[7] - p->z_hook * s[9];
        /* s[12] is the height of the mass plus the strap's length: below the hook it stretches the strap */
        double tension = p->strap_stiffness * (hook - s[12]) + p->strap_damping * (hook_rate - s[13]);
        if (tension < 0) tension = 0;
        add(&w, p->z_hook, tension * sx, tension * sy);
        rate = (tension - weight) / hung_mass;
    }
    double spin = s[11], unbalance = d->unbalance * spin * spin;
    double ec = d->unbalance_c, es = d->unbalance_s;
    memcpy(ds, s + 6, 6 * sizeof *ds);
    ds[6] = (w.fx + unbalance * (tc * ec - ts * es)) * d->per_mass + d->gravity_x;
    ds[7] = (w.fy + unbalance * (ts * ec + tc * es)) * d->per_mass + d->gravity_y;
    ds[8] = w.fz * d->per_mass;
    ds[9] = (w.mphi - d->polar_inertia * spin * s[10]) * d->per_inertia;
    ds[10] = (w.mpsi + d->polar_inertia * spin * s[9]) * d->per_inertia;
    ds[11] = w.torque * d->per_polar;
    ds[12] = hung_mass > 0 ? s[13] : 0;
    ds[13] = rate;
}

void tsbs_derivative(const tsbs_params *p, const double *s, const double *coil, const double *segment,
                     const double *play, double gamma, double hung_mass, double weight, const double *lever, double *ds) {
    tsbs_derived d;
    tsbs_derive(p, TICK, &d);
    double tc[4], ts[4];
    tsbs_at(&d, s[5], tc, ts);
    tsbs_reference at = {.gamma = gamma};
    tsbs_commutate(p, &d, &at);
    tsbs_hold(p, coil, lever, &d);
    double stator[8], mixed[8];
    for (int k = 0; k < 4; k++) {
        stator[k] = segment[k] * at.turn_c - segment[k + 4] * at.turn_s;
        stator[k + 4] = segment[k] * at.turn_s + segment[k + 4] * at.turn_c;
    }
    tsbs_mix(p, stator, mixed);
    d.near = 1;
    tsbs_rates(p, &d, s, coil, mixed, play, hung_mass, weight, ds);
}
