/* States of the firmware, at every reading of the positions: OFF, IDLE (no PWM), CURRENT (current loops, angle and z; in the
 * touchdown rings), LIFT (bearings on, out of the rings, gate running), LEVITATED, LANDING (down, bearings off in the rings, on to
 * z = 0; there into CURRENT, into IDLE where it was made safe, into FAULT where nobody listens), FAULT. L's VI-B: the gate wants all four radial readings within +-20 um for 250 ms; landing at 10 mm/s, off at 2.7 mm. */
#include <math.h>
#include <string.h>
#include "winding.h"

static void off(lira_state *st, int mode) {
    st->currents_on = st->bearings_on = st->angle_on = st->axial_on = 0;
    memset(st->stator, 0, sizeof st->stator);
    memset(st->capacitor, 0, sizeof st->capacitor);
    memset(st->ref_rate, 0, sizeof st->ref_rate);
    st->heard = -1;
    st->mode = mode;
}

static void trip(lira_state *st, int fault) {
    off(st, LIRA_FAULT);
    st->fault = fault;
}

/* from where an axis stands to a target, as fast as may be */
static void aim(lira_state *st, int j, double target, double speed, double rise) {
    st->target[j] = target;
    st->speed[j] = speed;
    st->rise[j] = rise;
}

/* currents, angle and z on, held where they are */
static void take_hold(lira_state *st) {
    for (int j = 0; j < 6; j++) {
        st->ref[j] = j < Z ? 0 : st->read[j];
        st->ref_rate[j] = 0;
        aim(st, j, st->ref[j], j == Z ? 0.5 : 18, j == Z ? 40 : 300);
    }
    memset(st->stator, 0, sizeof st->stator); /* which added up the sensors' offsets while nothing could answer */
    memset(st->capacitor, 0, sizeof st->capacitor);
    st->currents_on = st->angle_on = st->axial_on = 1;
    st->heard = st->tick;
    st->mode = LIRA_CURRENT;
}

static double farthest(const lira_state *st) {
    double out = 0;
    for (int k = 0; k < 4; k++) out = most(out, fabs(st->read[k]));
    return out;
}

static void lift(const lira_control *c, lira_state *st) {
    st->bearings_on = 1;
    memcpy(st->gated, st->read, sizeof st->gated);
    st->gate_clock = 0;
    st->mode = LIRA_LIFT;
    aim(st, Z, c->z_lift, c->v_lift, 1);
}

static void land(const lira_control *c, lira_state *st, int off_after) {
    st->off_after = off_after;
    st->gate_clock = 0;
    st->mode = LIRA_LANDING;
    aim(st, Z, 0, c->v_land, 1);
}

/* from wherever it is to where nothing flows; what is held is set down first */
static void make_safe(const lira_control *c, lira_state *st) {
    if (st->mode == LIRA_LIFT || st->mode == LIRA_LEVITATED) land(c, st, 1);
    else if (st->mode == LIRA_LANDING) st->off_after = 1;
    else if (st->mode == LIRA_CURRENT) off(st, LIRA_IDLE);
}

/* 0: done; 1: not in this state; 2: it stands too far from the middle to be lifted */
int32_t lira_command(const lira_params *p, const lira_control *c, lira_state *st, int32_t command) {
    (void)p;
    int still = st->mode == LIRA_OFF || st->mode == LIRA_IDLE;
    switch (command) {
    case DO_IDLE: return still ? (off(st, LIRA_IDLE), 0) : 1;
    case DO_ON: return st->mode == LIRA_IDLE ? (take_hold(st), 0) : 1;
    case DO_LIFT:
        if (st->mode != LIRA_CURRENT) return 1;
        return farthest(st) > c->refuse_m ? 2 : (lift(c, st), 0);
    case DO_LAND: return st->mode == LIRA_LIFT || st->mode == LIRA_LEVITATED ? (land(c, st, 0), 0) : 1;
    case DO_STOP: return st->mode == LIRA_FAULT ? 1 : (off(st, st->fault == FAULT_NONE ? LIRA_IDLE : LIRA_FAULT), 0);
    case DO_CLEAR:
        if (st->mode != LIRA_FAULT) return 1;
        off(st, LIRA_IDLE);
        st->fault = FAULT_NONE;
        return 0;
    case DO_SAFE: make_safe(c, st); return 0;
    default: return 1;
    }
}

/* A set point on its way: at the next sample as fast as the speed, the rise and the way left to brake in allow. To brake from the
 * next speed v takes v^2/(2 a), after a sample's way at the mean of this speed and the next. */
static void follow(lira_state *st, int j) {
    double left = st->target[j] - st->ref[j], a = st->rise[j], step = STEP_S, v = st->ref_rate[j], sense = left < 0 ? -1 : 1;
    if (a <= 0) { /* none: a step */
        st->ref[j] = st->target[j];
        st->ref_rate[j] = 0;
        return;
    }
    double room = most(fabs(left) - 0.5 * step * v * sense, 0), brake = 0.5 * a * step * (sqrt(1 + 8 * room / (a * step * step)) - 1);
    double wanted = sense * least(brake, st->speed[j]), next = clip(wanted, v - a * step, v + a * step);
    double moved = st->ref[j] + 0.5 * step * (v + next);
    int arrives = fabs(left) <= a * step * step && fabs(next) <= 2 * a * step;
    st->ref[j] = arrives ? st->target[j] : moved;
    st->ref_rate[j] = arrives ? 0 : next;
}

/* the farthest of the radial readings that the gate watches: all four, as they are, but where it is planted otherwise */
static double farthest_gated(const lira_control *c, lira_state *st) {
    double share = c->gate_lag_s > STEP_S ? STEP_S / c->gate_lag_s : 1, out = 0;
    for (int k = 0; k < 4; k++) {
        st->gated[k] = share < 1 ? st->gated[k] + share * (st->read[k] - st->gated[k]) : st->read[k];
        if ((int)c->gate_channels >> k & 1) out = most(out, fabs(st->gated[k]));
    }
    return out;
}

static void gate(const lira_control *c, lira_state *st) {
    double far = farthest_gated(c, st);
    int inside = st->ref[Z] == st->target[Z] && far <= c->gate_m;
    st->gate_clock = inside ? st->gate_clock + 1 : 0;
    if (st->gate_clock * STEP_S >= c->gate_s) st->mode = LIRA_LEVITATED;
}

static void set_down(const lira_control *c, lira_state *st) {
    if (st->bearings_on && st->read[Z] <= c->z_off) st->bearings_on = 0;
    st->gate_clock = !st->bearings_on && st->ref[Z] == st->target[Z] ? st->gate_clock + 1 : 0;
    if (st->gate_clock * STEP_S < c->rest_s) return;
    st->mode = LIRA_CURRENT;
    if (st->off_after) off(st, st->fault == FAULT_HOST ? LIRA_FAULT : LIRA_IDLE);
}

/* nobody listens: what is held is set down, the fault stays */
static void host_lost(const lira_control *c, lira_state *st) {
    st->fault = FAULT_HOST;
    if (st->mode == LIRA_CURRENT) off(st, LIRA_FAULT);
    else if (st->mode == LIRA_LANDING) st->off_after = 1;
    else land(c, st, 1);
    st->heard = -1;
}

static void watch(const lira_params *p, const lira_control *c, lira_state *st) {
    int lost = st->bearings_on && st->read[Z] > p->edge_out && farthest(st) > c->lost_m;
    st->lost_clock = lost ? st->lost_clock + 1 : 0;
    if (st->lost_clock * STEP_S >= c->lost_s) trip(st, FAULT_LOST);
    if (fabs(p->supply - c->supply_V) > 0.1 * c->supply_V) trip(st, FAULT_SUPPLY);
    for (int k = 0; k < BRIDGES; k++)
        if (fabs(st->coil[k]) > c->trip_A) trip(st, FAULT_CURRENT);
    int silent = st->heard >= 0 && (st->tick - st->heard) * LIRA_TICK > c->watchdog_s;
    if (silent) host_lost(c, st);
}

/* U = U_0 exp(-t/T) through the bleeder once nothing feeds the DC link; how fast it is charged again is not modelled */
static void feed(const lira_params *p, lira_state *st) {
    st->link = st->currents_on ? p->supply : st->link * exp(-STEP_S / p->discharge_s);
}

void lira_supervise(const lira_params *p, const lira_control *c, lira_state *st) {
    feed(p, st);
    if (st->mode < LIRA_CURRENT || st->mode == LIRA_FAULT) return;
    for (int j = 0; j < 6; j++) follow(st, j);
    if (st->mode == LIRA_LIFT) gate(c, st);
    if (st->mode == LIRA_LANDING) set_down(c, st);
    watch(p, c, st);
}
