/* The motor holds the outboard end: PID, or T (6.29) with an observer and active load balancing (T 6.7.3). */
#include <string.h>
#include "motor_law.h"

#define CIRCLE_M_S 1e-4 /* how fast the radius of the circle changes: 100 um in a second */

/* cos and sin of M gamma, kept while gamma stays */
static void field(const tsbs_control *c, tsbs_law_state *l) {
    if (l->gamma == l->field_gamma && l->field_c != 0) return;
    l->field_gamma = l->gamma;
    l->field_c = cos(c->pole_pairs * l->gamma);
    l->field_s = sin(c->pole_pairs * l->gamma);
}

/* where the motor is to hold its end: the set point, on the way from or to rest where the motor lifts, and a circle about it */
static void goal(const tsbs_control *c, tsbs_law_state *l, double *set) {
    double up = c->lift_by != 0 ? l->up : 1;
    l->circle = toward(l->circle, l->mode == LEVITATE ? c->circle_radius : 0, CIRCLE_M_S * TICK);
    l->circle_phase = l->circle != 0 ? remainder(l->circle_phase + TWO_PI * c->circle_hz * TICK, TWO_PI) : 0;
    double at[] = {c->ref_xm, c->ref_ym};
    for (int a = 0; a < 2; a++) set[a] = l->motor_rest[a] + up * (at[a] - l->motor_rest[a]);
    if (l->circle == 0) return;
    set[0] += l->circle * cos(l->circle_phase);
    set[1] += l->circle * sin(l->circle_phase);
}

/* The motor begins where the end is: at rest, where it lies. */
void tsbs_lie(tsbs_law_state *l, const double *y) {
    memcpy(l->motor_previous, y, sizeof l->motor_previous);
    memset(l->motor_integral, 0, sizeof l->motor_integral);
    memset(l->motor_filtered, 0, sizeof l->motor_filtered);
    memset(l->observed, 0, sizeof l->observed);
    memset(l->acted, 0, sizeof l->acted);
    memcpy(l->motor_rest, y, sizeof l->motor_rest);
    l->observed[0] = y[0];
    l->observed[3] = y[1];
    l->circle = l->circle_phase = l->balancing = 0;
}

/* Adds the motor's share to the currents i_x, i_y. While the motor lifts, its limit grows with the lift. */
void tsbs_carry(const tsbs_control *c, double keep, tsbs_law_state *l, const double *y, double *current) {
    double set[2], most = c->segment_max * (c->lift_by != 0 && l->mode == LIFT ? l->up : 1);
    if (l->share == 0) {
        tsbs_lie(l, y);
        return;
    }
    goal(c, l, set);
    tsbs_observe(c, l, y);
    if (c->balance != 0 || l->balancing != 0 || l->gamma != c->gamma) tsbs_balance(c, l);
    field(c, l);
    for (int a = 0; a < 2; a++) {
        double error = set[a] - y[a];
        l->motor_filtered[a] = keep * l->motor_filtered[a] + (1 - keep) * (y[a] - l->motor_previous[a]) / TICK;
        l->motor_previous[a] = y[a];
        double i = c->kp_m * error + l->motor_integral[a] - c->kd_m * l->motor_filtered[a];
        /* each axis waits by itself: one that waited for the other would drift away from its set point */
        if (fabs(i) < most || i * error < 0) l->motor_integral[a] += c->ki_m * error * TICK;
        if (c->balance == 0) current[a] += l->share * (c->lift_by != 0 ? clip(i, -most, most) : i);
    }
    if (c->balance == 0) return;
    /* T (6.29) in the fixed frame: f = -alpha_x' r - F + m' (Kp (r_ref - r) - Kd v); i' = R(phi) f / alpha_eff, where
     * alpha_eff e^(j phi) = alpha_d cos M gamma + j alpha_c sin M gamma (T 6.27, 6.28), so that no rate of phi is needed */
    const double *o = l->observed;
    double direct = c->model_alpha_d * l->field_c, cross = c->model_alpha_c * l->field_s;
    double f[2], square = direct * direct + cross * cross;
    if (c->balance == OTHER_SIGN) cross = -cross;
    for (int a = 0; a < 2; a++) {
        f[a] = c->model_mass * (c->kp_b * (set[a] - y[a]) - c->kd_b * o[3 * a + 1]) - c->model_stiffness * y[a] - o[3 * a + 2];
        l->motor_integral[a] = f[a] / c->model_alpha_d; /* the PID takes over without a jump */
    }
    current[0] += l->share * (direct * f[0] + cross * f[1]) / square;
    current[1] += l->share * (direct * f[1] - cross * f[0]) / square;
}

/* Position, velocity and constant load of each axis, in the fixed frame: T (6.30) there is linear and knows no rate of phi, so
 * that its error decays with three poles at observer_pole whatever gamma does. */
void tsbs_observe(const tsbs_control *c, tsbs_law_state *l, const double *y) {
    double p = c->observer_pole, m = c->model_mass;
    for (int a = 0; a < 2; a++) {
        double *o = l->observed + 3 * a, e = y[a] - o[0];
        double push = (c->model_stiffness * y[a] + o[2] + l->acted[a]) / m;
        o[0] += TICK * (o[1] + 3 * p * e);
        o[1] += TICK * (push + 3 * p * p * e);
        o[2] += TICK * m * p * p * p * e;
        l->load[a] = c->model_stiffness * y[a] + o[2];
    }
}

/* The phase angle: as it is set, or such that both currents are alike, T (6.37) and then (6.36). The load's direction is a line,
 * followed without a jump from where the constant load points when balancing begins: wrapped into two quadrants gamma would
 * have to change sides where the load is largest. */
void tsbs_balance(const tsbs_control *c, tsbs_law_state *l) {
    double to = c->gamma;
    if (c->balance != 0 && l->share > 0) {
        const double *f = l->observed;
        if (l->balancing == 0) l->line = f[2] != 0 ? atan(f[5] / f[2]) : PI / 2; /* nothing observed yet: weight pulls down */
        l->balancing = 1;
        l->line += remainder(atan2(l->load[1], l->load[0]) - l->line, PI);
        if (c->balance == WRAPPED) l->line = l->load[0] != 0 ? atan(l->load[1] / l->load[0]) : PI / 2;
        double past = fabs(l->line) - PI / 4, turn = l->line < 0 ? -past : past;
        to = atan2(c->model_alpha_d * sin(turn), c->model_alpha_c * cos(turn)) / c->pole_pairs;
        to = clip(to, -c->gamma_max, c->gamma_max);
    } else {
        l->balancing = 0;
    }
    l->gamma = c->gamma_slew > 0 ? toward(l->gamma, to, c->gamma_slew * TICK) : to;
}
