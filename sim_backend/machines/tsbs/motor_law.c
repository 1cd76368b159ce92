/* The motor's angle and speed, and how its segments share force and torque. */
#include <string.h>
#include "motor_law.h"

#define GUARD 5.0 /* A s/rad, with which a run at the torque limit ends at its speed */

/* Sharing of the segments. Static: T (6.9), the amplifiers cut what is too much, force with torque. Then T (6.19), force first,
 * what it leaves of segment_max for torque: lambda by T (6.24), or a half. Of six phases priority is T (7.13) within (7.18). */
enum { STATIC, PRIORITY, HALF };

static int limited(const tsbs_control *c) { return c->allocation == PRIORITY || c->allocation == HALF; }

static void tell(tsbs_law_state *l, double ix, double iy, double asked, double turn, double bound, double lambda) {
    const double told[] = {ix, iy, asked, turn, bound, lambda};
    memcpy(l->told, told, sizeof told);
}

/* T (7.12): i_q1 = i_theta + i_y, i_q2 = i_theta - i_y, i_d1 = -i_x, i_d2 = i_x, segments 1, 2 and 3, 4 alike. Printed (7.13c,d)
 * have the signs of i_y exchanged, and (7.18) is no bound; see docs/explanation/errata.md. Static: the amplifiers cut q and d. */
static void six(const tsbs_control *c, tsbs_law_state *l, double ix, double iy, double asked, tsbs_reference *out) {
    double most = c->segment_max, size = sqrt(ix * ix + iy * iy), turn = asked, bound = most;
    if (c->allocation == PRIORITY) {
        if (size > most && c->literal_7_18 == 0) ix *= most / size, iy *= most / size;
        double room = most * most - ix * ix, left = sqrt(room > 0 ? room : 0) - fabs(iy);
        bound = left > 0 ? left : c->literal_7_18 != 0 ? -left : 0;
        turn = clip(asked, -bound, bound);
    }
    double lifts = c->literal_7_13 != 0 ? -iy : iy, q[] = {turn + lifts, turn - lifts}, d[] = {-ix, ix};
    for (int k = 0; k < 2; k++) {
        double amplitude = sqrt(q[k] * q[k] + d[k] * d[k]), part = 1;
        if (c->allocation == PRIORITY && amplitude > most) part = most / amplitude * (1 - 1e-12); /* by a rounding error */
        out->segment[2 * k] = out->segment[2 * k + 1] = q[k] * part;
        out->across[2 * k] = out->across[2 * k + 1] = d[k] * part;
    }
    tell(l, ix, iy, asked, turn, bound, 0.5);
}

void tsbs_allocate(const tsbs_control *c, tsbs_law_state *l, double ix, double iy, double asked, tsbs_reference *out) {
    double lambda = 0.5, most = c->segment_max, bound = most, turn = asked, *i = out->segment;
    if (c->phases == 6) {
        six(c, l, ix, iy, asked, out);
        return;
    }
    if (limited(c)) {
        ix = clip(ix, -most, most);
        iy = clip(iy, -most, most);
        double left_x = most - fabs(ix), left_y = most - fabs(iy), left = left_x + left_y;
        bound = left / 2;
        if (c->allocation == HALF) bound = least(left_x, left_y);
        else if (left > 0) lambda = left_y / left;
        turn = clip(asked, -bound, bound);
    }
    i[0] = 2 * lambda * turn + iy;
    i[1] = 2 * (1 - lambda) * turn - ix;
    i[2] = 2 * lambda * turn - iy;
    i[3] = 2 * (1 - lambda) * turn + ix;
    if (limited(c))
        for (int k = 0; k < 4; k++) i[k] = clip(i[k], -most, most); /* no more than a rounding error */
    tell(l, ix, iy, asked, turn, bound, lambda);
}

/* what the motor's forces on the shaft will be, for the observer: note that they are those of currents within their limit */
static void act(const tsbs_control *c, tsbs_law_state *l, const tsbs_reference *out) {
    double most = c->segment_max, f = l->field_c, s = l->field_s, q[4], d[4];
    for (int k = 0; k < 4; k++) {
        double along = clip(out->segment[k], -most, most), across = out->across[k];
        q[k] = along * f - across * s;
        d[k] = along * s + across * f;
    }
    l->acted[0] = c->model_alpha_d * (q[3] - q[1]) / 2 - c->model_alpha_c * (d[0] - d[2]) / 2;
    l->acted[1] = c->model_alpha_d * (q[0] - q[2]) / 2 + c->model_alpha_c * (d[3] - d[1]) / 2;
}

/* what is added to the angle's reference: a sine that starts at nothing */
static double sine(const tsbs_control *c, tsbs_law_state *l) {
    if (c->sine_amplitude == 0) {
        l->sine_phase = 0;
        return 0;
    }
    l->sine_phase += TWO_PI * c->sine_hz * TICK;
    if (l->sine_phase > TWO_PI) l->sine_phase -= TWO_PI;
    return c->sine_amplitude * sin(l->sine_phase);
}

/* The torque current that is asked for. */
static double torque(const tsbs_control *c, const tsbs_gains *g, tsbs_law_state *l, const tsbs_reading *r) {
    double keep = g->angle_keep, angle = r->angle, swing = 0;
    l->angle_filtered = keep * l->angle_filtered + (1 - keep) * (angle - l->angle_previous) / TICK;
    l->angle_previous = angle;
    /* without torque (coasting, or no gains because something else turns the shaft) stand ready to take over where it is */
    int released = c->torque_on == 0 || (c->kp_theta == 0 && c->kd_theta == 0 && c->ki_theta == 0);
    int runs = c->torque_on != 0 && c->torque_limit_run != 0 && c->speed_ref != 0;
    if (released || runs) {
        l->angle_target = angle;
        l->speed_target = l->angle_filtered;
        l->angle_integral = 0;
        l->turns = whole_turns(angle - c->angle_ref);
    } else if (c->speed_ref != 0 || l->speed_target != 0) {
        l->speed_target = toward(l->speed_target, c->speed_ref, c->acceleration * TICK);
        l->angle_target += l->speed_target * TICK;
        l->turns = whole_turns(l->angle_target - c->angle_ref);
    } else {
        l->angle_target = toward(l->angle_target, c->angle_ref + l->turns, c->angle_slew * TICK);
        swing = sine(c, l);
    }
    double goal = l->angle_target + swing, error = goal - angle;
    l->goal_filtered = keep * l->goal_filtered + (1 - keep) * (goal - l->goal_previous) / TICK;
    l->goal_previous = goal;
    /* at the limit all the way, less only within some rad/s of the speed that guards it */
    if (runs) return clip(GUARD * (c->speed_ref - l->angle_filtered), -c->segment_max, c->segment_max);
    /* one encoder count is no error: an integrator that believed it would hunt against the Coulomb friction */
    double beyond = error - clip(error, -1.6e-3, 1.6e-3);
    l->angle_integral = clip(l->angle_integral + c->ki_theta * beyond * TICK, -2, 2);
    double rate = (c->derivative_on_error != 0 ? l->goal_filtered : l->speed_target) - l->angle_filtered;
    return released ? 0 : c->kp_theta * error + l->angle_integral + c->kd_theta * rate;
}

/* Axes turned by 45 degrees: x6 = (x + y)/sqrt 2, y6 = (-x + y)/sqrt 2, T (7.6) with the sign of (7.6b) put right; there
 * alpha_n = sqrt 2 alpha_c and alpha_t = sqrt 2 alpha_d. Printed (7.14) has a minus in front of all three controllers. */
static void own_frame(const tsbs_control *c, double *current, double *asked) {
    double x = current[0] + current[1], y = current[1] - current[0], way = c->literal_7_14 != 0 ? -1 : 1;
    current[0] = way * x / 2 * c->model_alpha_d / c->model_alpha_c;
    current[1] = (c->literal_7_6b != 0 ? -way : way) * y / 2;
    if (c->literal_7_14 == 1) *asked = -*asked; /* 2: those of the force alone */
}

void tsbs_rotate(const tsbs_control *c, const tsbs_gains *g, tsbs_law_state *l, const tsbs_reading *r, tsbs_reference *out) {
    double asked = torque(c, g, l, r), current[] = {0, 0};
    l->i_x = toward(l->i_x, c->i_x, c->i_ramp * TICK);
    l->i_y = toward(l->i_y, c->i_y, c->i_ramp * TICK);
    if (l->share == 0 && l->gamma != c->gamma) tsbs_balance(c, l);
    tsbs_carry(c, g->keep, l, r->position + 2, current);
    if (c->phases == 6) own_frame(c, current, &asked);
    tsbs_allocate(c, l, l->i_x + current[0], l->i_y + current[1], asked, out);
    if (l->share > 0) act(c, l, out);
    if (c->balance == UNLIMITED) { /* planted */
        double direct = c->model_alpha_d * l->field_c, cross = c->model_alpha_c * l->field_s;
        l->acted[0] = direct * current[0] - cross * current[1];
        l->acted[1] = direct * current[1] + cross * current[0];
    }
    out->gamma = l->gamma;
    out->ahead = c->lag_compensation != 0 ? l->angle_filtered * c->segment_lag : 0;
}
