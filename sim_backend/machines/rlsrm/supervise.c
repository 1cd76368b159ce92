/* States of the controller, at every reading: OFF, READY (no currents), HOMING, HOLDING, MOVING, STOPPING, FAULT. In OFF
 * loops can be switched by hand, for tests. A counter begins at zero wherever the mover stands at power on, so nothing is held
 * before its marks were seen. Homing needs no map: phases A, C, B of both stators, 30 degrees apart, take the rotor around, i^2
 * going from one to the next by degrees (in jumps the rotor would swing, for hardly anything damps it), until the mark has gone
 * by; then stator 0, and then stator 1, draw the mover along, while the other one goes on turning it: what turns has hardly any
 * friction along, and at the end of the stroke, where a stator has all but lost the mover, its force would not overcome it.
 * MAKE_SAFE and a silent host brake by the set points' own rise (a wave that is not sent but given stops at once, by what the
 * loops can); then currents go off, or the mover is held, as it is set. */
#include <math.h>
#include <string.h>
#include "rlsrm.h"
#include "numbers.h"

enum { STEPS_AROUND = 16, STEPS_ALONG = 3 };

/* a field that stands `standing` steps of 30 degrees on, so strong in both stators; phases align in the order A, C, B */
static void feed(rlsrm_state *st, double first, double second) {
    static const int ALIGNS[3] = {0, 2, 1};
    int step = (int)st->standing, now = ALIGNS[step % 3], next = ALIGNS[(step + 1) % 3];
    double part = st->standing - step, a = sqrt(1 - part), b = sqrt(part);
    for (int k = 0; k < PHASES; k++) st->manual[k] = 0;
    st->manual[now] = first * a;
    st->manual[next] = first * b;
    st->manual[3 + now] = second * a;
    st->manual[3 + next] = second * b;
}

static void rest(rlsrm_state *st, int mode) {
    memset(st->manual, 0, sizeof st->manual);
    st->pulse_left = 0;
    st->on = st->loop[X] = st->loop[ANGLE] = st->waves = 0;
    st->heard = -1;
    st->mode = mode;
}

static void trip(rlsrm_state *st, int fault) {
    rest(st, RLSRM_FAULT);
    st->fault = fault;
}

/* for faults that the core does not see by itself, and for tests of them */
void rlsrm_fail(rlsrm_state *st, int32_t fault) { trip(st, fault); }

/* loops closed where the mover is */
static void take_hold(rlsrm_state *st) {
    for (int k = 0; k < 2; k++) {
        st->ref[k] = st->target[k] = st->read[k];
        st->ref_rate[k] = st->integral[k] = st->slope[k] = 0;
        st->loop[k] = 1;
    }
    st->fresh = st->on = 1;
    st->heard = st->tick;
    st->mode = RLSRM_HOLDING;
}

/* set points come to rest as soon as their rise allows */
static void brake(const rlsrm_control *c, rlsrm_state *st, int letting_go) {
    for (int k = 0; k < 2; k++) {
        double rate = st->ref_rate[k], way = c->speed[k] > 0 && c->rise[k] > 0 ? 0.5 * rate * fabs(rate) / c->rise[k] : 0;
        st->target[k] = st->ref[k] + way;
    }
    st->waves = 0;
    st->letting_go = letting_go;
    st->mode = RLSRM_STOPPING;
}

static int moves(const rlsrm_state *st) { return st->mode >= RLSRM_HOLDING && st->mode <= RLSRM_STOPPING; }

static void begin_home(rlsrm_state *st) {
    st->homed[X] = st->homed[ANGLE] = st->stage = st->stage_clock = 0;
    st->mark_seen[X] = st->mark_seen[ANGLE] = st->home[X] = st->home[ANGLE] = 0;
    st->standing = 0;
    st->on = 1;
    st->heard = st->tick;
    st->mode = RLSRM_HOMING;
}

static void make_safe(const rlsrm_control *c, rlsrm_state *st) {
    if (moves(st)) brake(c, st, c->safe_holds == 0);
    else if (st->mode == RLSRM_HOMING) rest(st, RLSRM_READY);
    st->heard = -1; /* nobody is waited for any more */
}

static int32_t done(int may) { return may ? 0 : REFUSED; }

/* 0: done; 1: not in this state; 2: the zeros are not known */
int32_t rlsrm_command(const rlsrm_control *c, rlsrm_state *st, int32_t command) {
    int ready = st->mode == RLSRM_READY, held = moves(st);
    switch (command) {
    case DO_READY:
        if (st->mode == RLSRM_OFF) rest(st, RLSRM_READY);
        return done(st->mode == RLSRM_READY);
    case DO_HOME:
        if (ready) begin_home(st);
        return done(ready);
    case DO_HOLD:
        if (ready && !(st->homed[X] && st->homed[ANGLE])) return NOT_HOMED;
        if (ready) take_hold(st);
        return done(ready);
    case DO_PLAY:
        if (st->mode != RLSRM_HOLDING) return REFUSED;
        st->waves = 1;
        st->wave_start = st->tick;
        st->heard = st->tick;
        return 0;
    case DO_STOP:
        if (st->mode == RLSRM_HOMING) rest(st, RLSRM_READY);
        else if (held) brake(c, st, 0);
        return done(held || st->mode == RLSRM_READY);
    case DO_SAFE: make_safe(c, st); return 0;
    case DO_LET_GO:
        if (held) rest(st, RLSRM_READY);
        return done(held);
    case DO_OFF:
        if (ready || st->mode == RLSRM_HOLDING) rest(st, RLSRM_OFF);
        return done(st->mode == RLSRM_OFF);
    case DO_CLEAR:
        if (st->mode != RLSRM_FAULT) return REFUSED;
        rest(st, RLSRM_READY);
        st->fault = FAULT_NONE;
        return 0;
    default: return REFUSED;
    }
}

void rlsrm_power_on(const rlsrm_params *p, rlsrm_state *st) {
    rest(st, RLSRM_OFF);
    st->fault = FAULT_NONE;
    for (int k = 0; k < 2; k++) {
        st->base[k] = p->pitch[k] != 0 ? rlsrm_counted(p, st, k) : 0;
        st->count[k] = st->home[k] = 0;
        st->homed[k] = st->waves = 0;
        st->read[k] = 0;
    }
}

static void draw_along(const rlsrm_control *c, rlsrm_state *st, double part) {
    double amperes = c->home_current[X] * sqrt(least(2 * part, 1)), turning = 0.5 * c->home_current[ANGLE];
    if (fabs(st->rate_read[X]) > c->home_rate) amperes = 0; /* gently */
    if (st->stage % 2 == 0)
        feed(st, amperes, turning);
    else
        feed(st, turning, amperes);
}

/* no mark within its steps: not homed, which HOLD will say */
static void home(const rlsrm_control *c, rlsrm_state *st) {
    int axis = st->homed[ANGLE] ? X : ANGLE, ticks = (int)(c->home_s[axis] / LOOP_S);
    int seen = st->mark_seen[axis], over = !seen && st->stage >= (axis == ANGLE ? STEPS_AROUND : STEPS_ALONG);
    if (seen) {
        st->homed[axis] = 1;
        st->stage = st->stage_clock = 0;
    }
    if (over || st->homed[X]) {
        rest(st, RLSRM_READY);
        return;
    }
    st->standing += LOOP_S / c->home_s[ANGLE];
    if (st->homed[ANGLE])
        draw_along(c, st, (double)st->stage_clock / ticks);
    else
        feed(st, c->home_current[ANGLE], c->home_current[ANGLE]);
    if (++st->stage_clock < ticks) return;
    st->stage_clock = 0;
    st->stage++;
}

static void watch(const rlsrm_control *c, rlsrm_state *st) {
    for (int k = 0; k < PHASES; k++) {
        if (fabs(st->mean[k]) > c->trip_A) trip(st, FAULT_CURRENT);
        if (st->warm[k] > c->trip_warm) trip(st, FAULT_WARM);
    }
    for (int k = 0; k < 2; k++)
        if (fabs(st->rate_read[k]) > c->trip_rate[k]) trip(st, FAULT_SPEED);
    if (st->homed[X] && fabs(st->read[X]) > c->trip_m) trip(st, FAULT_STROKE);
    if (st->heard < 0 || (double)(st->tick - st->heard) * RLSRM_TICK <= c->watchdog_s) return;
    st->fault = FAULT_HOST;
    st->heard = -1;
    if (st->mode == RLSRM_HOMING) trip(st, FAULT_HOST);
    else brake(c, st, c->safe_holds == 0);
}

/* at rest: held, or without currents; where nobody listens it stays a fault, held or not */
static void come_to_rest(rlsrm_state *st) {
    int resting = 1;
    for (int k = 0; k < 2; k++) resting &= st->ref_rate[k] == 0 && st->ref[k] == st->target[k];
    if (st->mode == RLSRM_MOVING || st->mode == RLSRM_HOLDING) st->mode = resting && !st->waves ? RLSRM_HOLDING : RLSRM_MOVING;
    if (st->mode != RLSRM_STOPPING || !resting) return;
    int lost = st->fault == FAULT_HOST;
    if (st->letting_go) rest(st, lost ? RLSRM_FAULT : RLSRM_READY);
    else st->mode = lost ? RLSRM_FAULT : RLSRM_HOLDING;
}

/* READY: one phase may carry a current by itself */
static void test(const rlsrm_control *c, rlsrm_state *st) {
    int k = c->test_phase >= 0 && c->test_phase < PHASES ? (int)c->test_phase : -1;
    memset(st->manual, 0, sizeof st->manual);
    st->on = k >= 0;
    if (k >= 0) st->manual[k] = least(c->test_current, c->current_max);
    if (k != st->pulse_phase) st->pulse_left = 0;
}

void rlsrm_supervise(const rlsrm_params *p, const rlsrm_control *c, rlsrm_state *st) {
    (void)p;
    if (st->mode == RLSRM_HOMING) home(c, st);
    if (st->mode == RLSRM_READY) test(c, st);
    else st->pulse_left = 0;
    if (moves(st)) come_to_rest(st);
    if (st->mode != RLSRM_OFF && st->on) watch(c, st); /* what is held in FAULT, too */
}
