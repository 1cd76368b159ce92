/* The slow part of the firmware, 35 kHz: readings, observers (Luenberger, L table II), six PID loops, feedforward, dq references.
 *   observer 1 (what L's figures show): p- = p + T v, v- = v + T (lambda^2 p + F/M), p = p- + l11 (y - p-),
 *              v = v- + l22 ((y - y_last)/T - v-)
 *   observer 2: the same prediction, e = y - p-, p = p- + l11 e, v = v- + l22/T e
 * F is the clipped output of the loop, without gravity and cogging, which cancel the plant's; lambda^2 = 2 K_pull/m across. */
#include <math.h>
#include "winding.h"

/* what a step of so many s leaves of the radial sensors' lag of first order */
double lira_kept(const lira_params *p, double step_s) { return p->filter_lag > 0 ? exp(-step_s / p->filter_lag) : 0; }

/* the target's runout turns from y to x */
static void run_out(const lira_params *p, lira_state *st) {
    if (p->runout == 0) return;
    double at = p->runout_phase + p->runout_per_m * st->q[Z] - st->q[ANGLE];
    st->run[0] = p->runout * cos(at);
    st->run[1] = p->runout * sin(at);
}

/* places as the radial sensors see them, before gain, offset, noise and rounding: their lag is exact for what goes straight
 * through a step */
void lira_sight(const lira_params *p, lira_state *st, double step_s, double keep) {
    const double *q = st->q;
    if (st->tick % POSITION_TICKS == 0) run_out(p, st);
    for (int k = 0; k < 4; k++) {
        double lever = (k & 1 ? -1 : 1) * p->sensor_plane - (q[Z] - p->middle);
        double now = k < 2 ? q[0] + q[3] * lever + st->run[0] : q[1] - q[2] * lever + st->run[1];
        if (st->fresh) st->filtered[k] = st->sighted[k] = now;
        double behind = p->filter_lag * (now - st->sighted[k]) / step_s;
        st->filtered[k] = now - behind + keep * (st->filtered[k] - st->sighted[k] + behind);
        st->sighted[k] = now;
    }
}

static void read(const lira_params *p, lira_state *st) {
    double normal[6];
    core_draws(&st->noise, normal, 6);
    for (int j = 0; j < 6; j++) {
        double x = p->position_gain[j] * (j < 4 ? st->filtered[j] : st->q[j]) + p->position_offset[j];
        double lsb = p->position_lsb[j];
        st->read[j] = quantise(x + p->position_noise[j] * normal[j], lsb, lsb > 0 ? 1 / lsb : 0);
    }
}

typedef struct {
    double kp, ki, kd, limit, l11, l22, mass, square;
} gains;

static INLINE gains of_loop(const lira_control *c, int j) {
    if (j == Z) return (gains){c->kp_z, c->ki_z, c->kd_z, c->sat_z, c->l11_z, c->l22_z, c->model_mass, 0};
    if (j == ANGLE) return (gains){c->kp_r, c->ki_r, c->kd_r, c->sat_r, c->l11_r, c->l22_r, c->model_inertia, 0};
    double mass = c->model_mass / 2;
    return (gains){c->kp_b, c->ki_b, c->kd_b, c->sat_b, c->l11_b, c->l22_b, mass, c->observer_pull != 0 ? c->model_pull / mass : 0};
}

static INLINE void observe(const lira_control *c, lira_state *st, int j, const gains *g, double y, double force) {
    double p = st->seen[j] + STEP_S * st->seen_rate[j];
    double v = st->seen_rate[j] + STEP_S * (g->square * st->seen[j] + force / g->mass);
    if (c->observer == 2) {
        st->seen[j] = p + g->l11 * (y - p);
        st->seen_rate[j] = v + g->l22 / STEP_S * (y - p);
    } else if (c->observer == 1) {
        st->seen[j] = p + g->l11 * (y - p);
        st->seen_rate[j] = v + g->l22 * ((y - st->was[j]) / STEP_S - v);
    } else { /* none: the difference */
        st->seen[j] = y;
        st->seen_rate[j] = (y - st->was[j]) / STEP_S;
    }
    st->was[j] = y;
}

/* what is injected at this sample, and its rate */
static INLINE double injected(const lira_control *c, lira_state *st, double *rate) {
    *rate = 0;
    st->injected = st->wave = 0;
    if (c->inject_axis < 0) return 0;
    st->phase += TWO_PI * c->inject_hz * STEP_S;
    *rate = TWO_PI * c->inject_hz * c->inject_amplitude * cos(st->phase);
    st->wave = sin(st->phase);
    return st->injected = c->inject_amplitude * st->wave;
}

static INLINE double loop(const lira_control *c, lira_state *st, int j, int on, double tone, double tone_rate) {
    gains g = of_loop(c, j);
    int place = (int)c->inject_axis == j ? (int)c->inject_place : -1;
    double y = st->read[j] + (place == 0 ? tone : 0), r = st->ref[j] + (place == 1 ? tone : 0);
    double rate = st->ref_rate[j] + (place == 1 ? tone_rate : 0);
    observe(c, st, j, &g, y, on ? st->force[j] : 0);
    if (!on) return st->summed[j] = 0;
    if (j < Z && st->held) return st->force[j]; /* which its frozen current gives; the integrator waits */
    double e = r - y, wanted = g.kp * e + st->summed[j] + g.kd * (rate - st->seen_rate[j]);
    double force = clip(wanted, -g.limit, g.limit);
    if (force != wanted) st->limited |= 1 << j;
    else if (j >= Z || st->read[Z] >= c->frozen_below) st->summed[j] += g.ki * STEP_S * e;
    return force;
}

/* phases by the encoders as the fast part will use them until the next reading */
static void turn(const lira_control *c, lira_state *st) {
    const double zero[2] = {c->zero_ra1, c->one_zero != 0 ? c->zero_ra1 : c->zero_ra2};
    for (int a = 0; a < 2; a++) {
        st->cos_ra[a] = cos(POLE_PAIRS * st->read[ANGLE] - zero[a]);
        st->sin_ra[a] = sin(POLE_PAIRS * st->read[ANGLE] - zero[a]);
    }
    st->cos_la = cos(TWO_PI / c->model_pitch * st->read[Z] - c->zero_la);
    st->sin_la = sin(TWO_PI / c->model_pitch * st->read[Z] - c->zero_la);
}

void lira_positions(const lira_params *p, const lira_control *c, lira_state *st) {
    double rate, tone = injected(c, st, &rate);
    read(p, st);
    if (st->fresh)
        for (int j = 0; j < 6; j++) st->was[j] = st->seen[j] = st->read[j];
    st->fresh = st->limited = 0;
    lira_supervise(p, c, st);
    lira_hold_on(c, st);
    int on[6] = {st->bearings_on, st->bearings_on, st->bearings_on, st->bearings_on, st->axial_on, st->angle_on};
    for (int j = 0; j < 6; j++) {
        double extra = (int)c->inject_axis == j && (int)c->inject_place == 2 && on[j] ? tone : 0;
        st->force[j] = loop(c, st, j, on[j], tone, rate) + extra;
    }
    double weight = st->bearings_on ? c->model_mass / 2 * c->gravity : 0;
    for (int a = 0; a < 2; a++) {
        double up = st->force[Y1 + a] + weight;
        if (c->limit_after_ff != 0) up = clip(up, -c->sat_b, c->sat_b);
        st->wanted[4 * a] = 0;
        st->wanted[4 * a + 2] = st->force[X1 + a] / c->model_bearing;
        st->wanted[4 * a + 3] = up / c->model_bearing;
    }
    lira_frozen(c, st, weight);
    double axial = st->force[Z] + (st->axial_on ? c->model_cogging_force * sin(2 * TWO_PI / c->model_pitch * st->read[Z]) : 0);
    double torque = st->force[ANGLE] + (st->angle_on ? c->model_cogging_torque * sin(6 * POLE_PAIRS * st->read[ANGLE]) : 0);
    st->wanted[1] = st->wanted[5] = torque / (2 * c->model_torque);
    st->wanted[8] = 0;
    st->wanted[9] = axial / c->model_force;
    for (int k = 0; k < 10; k++) st->wanted[k] += st->manual[k];
    turn(c, st);
}
