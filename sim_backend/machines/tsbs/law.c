/* Control law: a pure function of the readings, its own state and its parameters, called every 100 us.
 * The AMBs: PID in the actuator planes, constant current sum. The motor: motor_law.c. */
#include <string.h>
#include "motor_law.h"

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
    l->up = up;
    if (c->lift_by != 0) l->share = 1;
    else l->share = toward(l->share, held ? c->motor_share : 0, (held ? c->share_slew : 10) * TICK);
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
            l->share = l->sine_phase = l->balancing = 0;
            tsbs_lie(l, y + 2);
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
        l->gamma = c->gamma;
        return;
    }
    radial(c, g, l, plane, out);
    tsbs_rotate(c, g, l, r, out);
    if (l->mode == LAND && l->lift_clock >= c->lift_time_s) memset(out, 0, sizeof *out);
}
