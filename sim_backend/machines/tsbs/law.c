/* Control law: a pure function of the readings, its own state and its parameters, called every 100 us.
 * PID in the actuator planes, constant current sum; slew-limited angle; open-loop motor currents through T (6.9). */
#include <math.h>
#include <string.h>
#include "numbers.h"
#include "tsbs.h"

/* share of a first-order filter's memory that survives a tick (backward Euler) */
#define KEEP(hz) (1 / (1 + TWO_PI * (hz) * TICK))

static double toward(double from, double to, double step) { return from + clip(to - from, -step, step); }

/* a set angle is meant within a turn: after spinning, the nearest such angle is the target, not the way back */
static double whole_turns(double angle) { return TWO_PI * floor(angle / TWO_PI + 0.5); }

/* share of the way that the references have gone from the rest position to the set point */
static double lifted(const tsbs_control *c, tsbs_law_state *l) {
    if (l->mode == LEVITATE) return 1;
    double t = l->lift_clock / c->lift_time_s;
    l->lift_clock += TICK;
    if (l->lift_clock > c->lift_time_s) l->lift_clock = c->lift_time_s;
    double smooth = t * t * (3 - 2 * t);
    return l->mode == LIFT ? smooth : 1 - smooth;
}

void tsbs_settle(const tsbs_control *c, tsbs_gains *g) {
    const double kp[] = {c->kp_i, c->kp_i, c->kp_o, c->kp_o, c->kp_z}, kd[] = {c->kd_i, c->kd_i, c->kd_o, c->kd_o, c->kd_z};
    const double ki[] = {c->ki_i, c->ki_i, c->ki_o, c->ki_o, c->ki_z};
    const double bias[] = {c->bias_i, c->bias_i, c->bias_o, c->bias_o, c->bias_z};
    const double set[] = {c->ref_xi, c->ref_yi, c->ref_xo, c->ref_yo, c->ref_z};
    memcpy(g->kp, kp, sizeof kp);
    memcpy(g->kd, kd, sizeof kd);
    memcpy(g->ki, ki, sizeof ki);
    memcpy(g->bias, bias, sizeof bias);
    memcpy(g->set, set, sizeof set);
    g->keep = KEEP(c->derivative_hz);
    g->angle_keep = KEEP(c->angle_hz);
}

/* the filtered rates of the five axes: one after the other without a branch, so that the divisions go side by side */
static void rates(tsbs_law_state *l, double keep, const double *plane) {
    for (int a = 0; a < 5; a++) {
        l->filtered[a] = keep * l->filtered[a] + (1 - keep) * (plane[a] - l->previous[a]) / TICK;
        l->previous[a] = plane[a];
    }
}

static void radial(const tsbs_control *c, const tsbs_gains *g, tsbs_law_state *l, const double *plane, tsbs_reference *out) {
    double up = lifted(c, l);
    int held = l->mode == LEVITATE; /* a landing is the bearings': the motor hands back within 0.1 s */
    l->share = toward(l->share, held ? c->motor_share : 0, (held ? c->share_slew : 10) * TICK);
    rates(l, g->keep, plane);
    for (int a = 0; a < 5; a++) {
        double error = l->rest[a] + up * (g->set[a] - l->rest[a]) - plane[a], bias = g->bias[a];
        double control = g->kp[a] * error + l->integral[a] - g->kd[a] * l->filtered[a], room = c->current_limit - bias;
        int waits = l->share > 0 && (a == 2 || a == 3); /* the outboard AMB takes up again what it carried */
        if (!waits && (fabs(control) < room || control * error < 0)) l->integral[a] += g->ki[a] * error * TICK;
        control = clip(control, -room, room);
        out->coil[2 * a] = clip(bias + control, 0, c->current_limit);
        out->coil[2 * a + 1] = clip(bias - control, 0, c->current_limit);
    }
    if (l->share > 0)
        for (int k = 4; k < 8; k++) out->coil[k] *= 1 - l->share;
}

/* The motor holds the outboard end: PID on the outboard sensors. Adds the share of its currents to those of i_x, i_y. */
static void carry(const tsbs_control *c, double keep, tsbs_law_state *l, const double *y, double *current) {
    const double set[] = {c->ref_xm, c->ref_ym};
    if (l->share == 0) {
        memcpy(l->motor_previous, y, sizeof l->motor_previous);
        memset(l->motor_integral, 0, sizeof l->motor_integral);
        memset(l->motor_filtered, 0, sizeof l->motor_filtered);
        return;
    }
    for (int a = 0; a < 2; a++) {
        double error = set[a] - y[a];
        l->motor_filtered[a] = keep * l->motor_filtered[a] + (1 - keep) * (y[a] - l->motor_previous[a]) / TICK;
        l->motor_previous[a] = y[a];
        double i = c->kp_m * error + l->motor_integral[a] - c->kd_m * l->motor_filtered[a];
        if (fabs(i) < c->segment_max || i * error < 0) l->motor_integral[a] += c->ki_m * error * TICK;
        current[a] += l->share * i;
    }
}

/* Segment currents from the three demands. 0: T (6.9), the amplifiers cut what is too much, force with torque.
 * 1: T (6.19) with (6.24), force first; what it leaves of segment_max is shared so that the torque is largest. */
static void allocate(const tsbs_control *c, double ix, double iy, double turn, double *i) {
    double share_x = 1, share_y = 1, most = c->segment_max; /* shares: 2 (1 - lambda), 2 lambda */
    if (c->allocation != 0) {
        ix = clip(ix, -most, most);
        iy = clip(iy, -most, most);
        double left_x = most - fabs(ix), left_y = most - fabs(iy), left = left_x + left_y;
        turn = clip(turn, -left / 2, left / 2);
        if (left > 0) {
            share_x = 2 * left_x / left;
            share_y = 2 * left_y / left;
        }
    }
    i[0] = share_y * turn + iy;
    i[1] = share_x * turn - ix;
    i[2] = share_y * turn - iy;
    i[3] = share_x * turn + ix;
    if (c->allocation != 0)
        for (int k = 0; k < 4; k++) i[k] = clip(i[k], -most, most); /* no more than a rounding error */
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

static void rotation(const tsbs_control *c, const tsbs_gains *g, tsbs_law_state *l, const tsbs_reading *r, tsbs_reference *out) {
    double keep = g->angle_keep, angle = r->angle, swing = 0;
    l->angle_filtered = keep * l->angle_filtered + (1 - keep) * (angle - l->angle_previous) / TICK;
    l->angle_previous = angle;
    /* without torque (coasting, or no gains because something else turns the shaft) stand ready to take over where it is */
    int released = c->torque_on == 0 || (c->kp_theta == 0 && c->kd_theta == 0 && c->ki_theta == 0);
    if (released) {
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
    /* one encoder count is no error: an integrator that believed it would hunt against the Coulomb friction */
    double beyond = error - clip(error, -1.6e-3, 1.6e-3);
    l->angle_integral = clip(l->angle_integral + c->ki_theta * beyond * TICK, -2, 2);
    double rate = (c->derivative_on_error != 0 ? l->goal_filtered : l->speed_target) - l->angle_filtered;
    double i = released ? 0 : c->kp_theta * error + l->angle_integral + c->kd_theta * rate;
    l->i_x = toward(l->i_x, c->i_x, c->i_ramp * TICK);
    l->i_y = toward(l->i_y, c->i_y, c->i_ramp * TICK);
    double current[] = {l->i_x, l->i_y};
    carry(c, g->keep, l, r->position + 2, current);
    allocate(c, current[0], current[1], i, out->segment);
    out->gamma = c->gamma;
    out->ahead = c->lag_compensation != 0 ? l->angle_filtered * c->segment_lag : 0;
}

void tsbs_law(const tsbs_control *c, tsbs_law_state *l, const tsbs_reading *r, tsbs_reference *out) {
    tsbs_gains g;
    tsbs_settle(c, &g);
    tsbs_act(c, &g, l, r, out);
}

void tsbs_act(const tsbs_control *c, const tsbs_gains *g, tsbs_law_state *l, const tsbs_reading *r, tsbs_reference *out) {
    const double *y = r->position;
    double plane[5];
    for (int a = 0; a < 2; a++) { /* T (6.7) with the controller's own geometry */
        plane[a] = y[a] + c->share_i * (y[a + 2] - y[a]);
        plane[a + 2] = y[a] + c->share_o * (y[a + 2] - y[a]);
    }
    plane[4] = y[4];
    memset(out, 0, sizeof *out);
    if (l->fresh) { /* first tick after a change from rest: no derivative kick, references start where the rotor lies */
        memcpy(l->previous, plane, sizeof plane);
        memcpy(l->motor_previous, y + 2, sizeof l->motor_previous);
        l->angle_previous = l->goal_previous = r->angle;
        if (l->mode == LIFT) {
            memcpy(l->rest, plane, sizeof plane);
            memset(l->integral, 0, sizeof l->integral);
            memset(l->filtered, 0, sizeof l->filtered);
            l->angle_target = r->angle;
            l->speed_target = l->angle_integral = l->angle_filtered = l->goal_filtered = l->i_x = l->i_y = 0;
            l->share = l->sine_phase = 0;
            l->turns = whole_turns(r->angle - c->angle_ref);
        }
        l->fresh = 0;
    }
    if (l->mode < LIFT) {
        memcpy(l->previous, plane, sizeof plane);
        double keep = g->angle_keep;
        l->angle_filtered = keep * l->angle_filtered + (1 - keep) * (r->angle - l->angle_previous) / TICK;
        l->angle_previous = l->goal_previous = r->angle;
        l->angle_target = r->angle;
        return;
    }
    radial(c, g, l, plane, out);
    rotation(c, g, l, r, out);
    if (l->mode == LAND && l->lift_clock >= c->lift_time_s) memset(out, 0, sizeof *out);
}
