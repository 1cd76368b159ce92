/* Control laws, each a pure function of the readings, its own state and its parameters, called every 100 us:
 * decentralised PID (T 2.4.3 with its wiring corrected), flatness (T 2.14-2.16) with CCS (2.25) or CAC (2.22). */
#include <math.h>
#include <string.h>
#include "amb5dof.h"
#include "signal.h"

#define KEEP(hz) (1 / (1 + TWO_PI * (hz) * TICK))
enum { PID, CCS, CAC };

/* T (2.25) without its branch. With D = kappa^2 - xi^2,
 * di = (F D^2/b - 4 kappa xi ib^2)/(2 [(kappa^2 + xi^2) ib + D sqrt(ib^2 + kappa xi F/b)]),
 * for forces within -4 b ib^2/(kappa + xi)^2 <= F <= 4 b ib^2/(kappa - xi)^2; what is outside is cut. */
double amb_ccs(double force, double beta, double gap, double xi, double bias) {
    double near = gap - xi, far = gap + xi, d = near * far, f = force / beta, most = 4 * bias * bias;
    if (f * near * near >= most) return bias;
    if (f * far * far <= -most) return -bias;
    double root = sqrt(fmax(bias * bias + gap * xi * f, 0));
    return (f * d * d - gap * xi * most) / (2 * ((gap * gap + xi * xi) * bias + d * root));
}

/* T (2.22), (2.23): only the coil on the side of the force carries current, but for |F| < eta */
void amb_cac(double force, double beta, double gap, double xi, double eta, double *pair) {
    double y = 0, other = 0;
    if (force >= eta) {
        y = sqrt(force / beta);
    } else if (force < -eta) {
        other = sqrt(-force / beta);
    } else {
        double t = (force + eta) / eta; /* T: P_eta = sqrt(eta) t^3 (15/16 - 13/16 t + 17/64 t^2 - 1/32 t^3) */
        y = sqrt(eta / beta) * t * t * t * (15.0 / 16 - t * (13.0 / 16 - t * (17.0 / 64 - t / 32)));
        other = sqrt(fmax(y * y - force / beta, 0));
    }
    pair[0] = (gap - xi) * y;
    pair[1] = (gap + xi) * other;
}

/* T (2.14) with psi about y and theta about z: forces that give the accelerations v, the coupling included */
static void flat(const amb_control *c, const double *q, const double *rate, const double *v, double speed, double *force) {
    double in = c->model_l_ia + q[X], out = c->model_l_oa - q[X], per_span = 1 / (in + out), gyro = c->model_polar * speed;
    double cy = -c->model_coupling * (q[Y] - c->model_l_c * q[THETA]);
    double cz = -c->model_coupling * (q[Z] + c->model_l_c * q[PSI]);
    double ay = c->model_mass * (v[Y] - c->model_gravity_y) - cy, az = c->model_mass * (v[Z] - c->model_gravity_z) - cz;
    double my = c->model_inertia * v[THETA] - gyro * rate[PSI] + c->model_l_c * cy; /* out F_o - in F_i */
    double mz = c->model_inertia * v[PSI] + gyro * rate[THETA] - c->model_l_c * cz; /* in F_i - out F_o */
    force[YI] = (out * ay - my) * per_span;
    force[YO] = (in * ay + my) * per_span;
    force[ZI] = (out * az + mz) * per_span;
    force[ZO] = (in * az - mz) * per_span;
    force[AXIAL] = c->model_mass * v[X];
}

/* Differential current by CCS of a slow force and a synchronous one. What the synchronous one must lead by is added to the
 * current by the slope of (2.24) at the slow force: the amplifiers take it off again, and with it nothing of the mean force,
 * which goes with the square of the current. */
static double leading(const amb_control *c, double slow, double wave, double ahead, double beta, double gap, double xi) {
    double di = amb_ccs(slow + wave, beta, gap, xi, c->bias), near = gap - xi, far = gap + xi;
    if (ahead == wave) return di;
    double at = amb_ccs(slow, beta, gap, xi, c->bias);
    double slope = 2 * beta * ((c->bias + at) / (near * near) + (c->bias - at) / (far * far));
    return clip(di + (ahead - wave) / slope, -c->bias, c->bias);
}

static void invert(const amb_control *c, int law, const double *q, const double *force, const double *wave, const double *ahead,
                   double *coil) {
    double xi[5], beta[5];
    amb_magnetic(c, q, xi);
    amb_betas(c, beta);
    for (int k = 0; k < 5; k++) {
        double gap = k == AXIAL ? c->model_gap_x : c->model_gap, at = clip(xi[k], -0.9 * gap, 0.9 * gap), *pair = coil + 2 * k;
        if (law == CAC) {
            amb_cac(force[k] + ahead[k], beta[k], gap, at, c->eta, pair);
        } else {
            double di = leading(c, force[k], wave[k], ahead[k], beta[k], gap, at);
            pair[0] = c->bias + di, pair[1] = c->bias - di;
        }
    }
}

/* what the law and its observer make of the disturbance: accelerations to work against; the synchronous ones apart, as they
 * are and as they are to be commanded */
typedef struct {
    double against[5], wave[5], ahead[5];
} estimate;

/* forces that a change of the accelerations by -v makes: T (2.14) is linear in them */
static void against(const amb_control *c, double x, const double *v, double *force) {
    double in = c->model_l_ia + x, out = c->model_l_oa - x, per_span = 1 / (in + out), m = c->model_mass, j = c->model_inertia;
    force[YI] = -(m * out * v[Y] - j * v[THETA]) * per_span;
    force[YO] = -(m * in * v[Y] + j * v[THETA]) * per_span;
    force[ZI] = -(m * out * v[Z] + j * v[PSI]) * per_span;
    force[ZO] = -(m * in * v[Z] - j * v[PSI]) * per_span;
    force[AXIAL] = 0;
}

static void flatness(const amb_control *c, amb_law_state *l, const double *q, const double *rate, const estimate *e,
                     const amb_motion *m, double speed, double *coil) {
    double v[5], force[5], wave[5] = {0}, ahead[5] = {0}, k2 = l->law == CAC ? c->k2_cac : c->k2_ccs;
    for (int k = 0; k < 5; k++) { /* T (2.16); a gain that changes leaves the sum alone */
        double error = q[k] - m->r[k];
        if (c->integral != 0 || k == X) l->sum[k] += c->k0 * error * TICK;
        v[k] = m->a[k] - k2 * (rate[k] - m->v[k]) - c->k1 * error - e->against[k];
        if (c->integral != 0 || k == X) v[k] -= l->sum[k];
    }
    flat(c, q, rate, v, speed, force);
    if (l->observer.turning) {
        against(c, q[X], e->wave, wave);
        against(c, q[X], e->ahead, ahead);
    }
    invert(c, l->law, q, force, wave, ahead, coil);
}

/* T 2.4.3: y from W, z from V. The derivative acts on the error; of a set point that jumps there is none. */
static void pid(const amb_control *c, amb_law_state *l, const double *at, const amb_motion *m, double *coil) {
    double r[5], v[5];
    amb_planes(c, m->r, r);
    amb_planes(c, m->v, v);
    for (int k = 0; k < 5; k++) {
        double error = r[k] - at[k], di = c->kp * error + l->pid[k] + c->kd * (v[k] - l->filtered[k]);
        if (fabs(di) < c->bias || di * error < 0) l->pid[k] += c->ki * error * TICK;
        di = clip(di, -c->bias, c->bias);
        coil[2 * k] = c->bias + di, coil[2 * k + 1] = c->bias - di;
    }
}

/* The laws' integrators as they are when nothing is amiss: the PID's holds the weight in the magnetic fields at r. */
static void begin(const amb_control *c, amb_law_state *l, const double *r) {
    double still[5] = {0}, force[5], xi[5], beta[5];
    flat(c, r, still, still, 0, force);
    amb_magnetic(c, r, xi);
    amb_betas(c, beta);
    memset(l->sum, 0, sizeof l->sum);
    for (int k = 0; k < 5; k++)
        l->pid[k] = amb_ccs(force[k], beta[k], k == AXIAL ? c->model_gap_x : c->model_gap, xi[k], c->bias);
    l->law = (int)c->law;
}

static void filter(const amb_control *c, amb_law_state *l, const double *at) {
    double keep = KEEP(c->derivative_hz);
    for (int k = 0; k < 5; k++) {
        l->filtered[k] = keep * l->filtered[k] + (1 - keep) * (at[k] - l->previous[k]) * PER_TICK;
        l->previous[k] = at[k];
    }
}

static void start(const amb_control *c, amb_law_state *l, const double *at) {
    memcpy(l->previous, at, sizeof l->previous);
    memset(l->filtered, 0, sizeof l->filtered);
    memset(&l->observer, 0, sizeof l->observer);
    memset(l->waiting, 0, sizeof l->waiting);
    if (l->mode >= LIFT) {
        double set[5] = {c->ref_x, c->ref_y, c->ref_z, c->ref_psi, c->ref_theta};
        amb_coordinates(c, at, at[AXIAL], l->rest);
        memcpy(l->set, set, sizeof set);
        l->share = l->phase = 0;
        begin(c, l, set);
    }
    l->fresh = 0;
}

static void inject(const amb_control *c, amb_law_state *l, amb_reference *out) {
    int axis = c->inject_axis < 0 ? 0 : c->inject_axis > 4 ? 4 : (int)c->inject_axis;
    double *pair = out->coil + 2 * axis;
    core_injection asked = {c->inject_axis, c->inject_amplitude, c->inject_hz, c->inject_lines, c->inject_step};
    out->inject = core_injected(&asked, &l->tones, TICK);
    out->before = (pair[0] - pair[1]) / 2;
    pair[0] = clip(pair[0] + out->inject, 0, c->current_limit);
    pair[1] = clip(pair[1] - out->inject, 0, c->current_limit);
    out->after = (pair[0] - pair[1]) / 2;
}

void amb_law(const amb_control *c, amb_law_state *l, const amb_reading *r, amb_reference *out) {
    double at[5], q[5], rate[5];
    estimate e = {0};
    amb_motion m;
    memcpy(at, r->position, sizeof at);
    memset(out, 0, sizeof *out);
    amb_notched(c, &l->notch, at);
    if (l->fresh) start(c, l, at);
    filter(c, l, at);
    if (l->mode < LIFT) return;
    int landed = l->mode == LAND && l->lift_clock >= c->lift_time_s;
    if ((int)c->law != l->law) begin(c, l, l->set);
    amb_refer(c, l, &m);
    amb_coordinates(c, at, at[AXIAL], q);
    amb_coordinates(c, l->filtered, 0, rate);
    if (l->law == PID) {
        pid(c, l, at, &m, out->coil);
    } else {
        if (c->observer != 0) amb_observe(c, l, q, r->speed, rate, e.against, e.wave, e.ahead);
        flatness(c, l, q, rate, &e, &m, r->speed, out->coil);
    }
    for (int k = 0; k < 10; k++) out->coil[k] = clip(out->coil[k], 0, c->current_limit);
    inject(c, l, out);
    if (landed) memset(out, 0, sizeof *out);
    memcpy(l->sent, l->waiting, sizeof l->sent);
    memcpy(l->waiting, out->coil, sizeof l->waiting);
}
