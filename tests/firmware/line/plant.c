/* A small plant of its own: each dq current follows its reference by a law of second order, positions go where they are sent. */
#define _XOPEN_SOURCE 600
#include "line.h"
#include <math.h>

#define NATURAL (2 * M_PI * 4000) /* rad/s */
#define ZETA 0.6
#define NOISE 5e-3     /* A, standard deviation */
#define TIMED (3 * TICKS / 10) /* a lift and a landing */
#define HEARTBEAT_LOST 4
#define LIFTED 8e-3 /* m */
#define RESTING -25e-6
#define SUPPLY 400.0

const char *const state_names[7] = {"OFF", "IDLE", "CURRENT", "LIFT", "LEVITATED", "LANDING", "FAULT"};
const char *const axis_names[6] = {"x1", "x2", "y1", "y2", "z", "gamma"};
const char *const fault_names[5] = {"NONE", "LEVITATION_LOST", "OVERCURRENT", "SUPPLY", "HEARTBEAT_LOST"};
uint64_t tick, watchdog = TICKS * 80 / 1000;
int fault;
enum state state = OFF;
double step_of[CURRENTS];
uint64_t step_ends[CURRENTS];
struct move moves[6];

static struct { double value, rate; } current[CURRENTS];
static const double carrying[CURRENTS] = {0, 0, 0, 1.77, 0, 0, 0, 1.77, 0, 0}; /* A: half the weight by 3.7 N/A each */
static double yy, yv, vy, vv; /* one tick of the law without reference */
static uint64_t since, heartbeat, seed = 88172645463325252u;
static enum state after;
static double from_z, before_gamma;
static struct { int axis, sensor; double amplitude, hz; } sine = {-1, 0, 0, 0};
static unsigned counter = 0x10000;

void plant_start(void)
{
    double wd = NATURAL * sqrt(1 - ZETA * ZETA), t = 1.0 / TICKS, e = exp(-ZETA * NATURAL * t);
    double s = e * sin(wd * t) / wd, c = e * cos(wd * t);
    yy = c + ZETA * NATURAL * s;
    yv = s;
    vy = -NATURAL * NATURAL * s;
    vv = c - ZETA * NATURAL * s;
}

static double noise(void)
{
    double sum = -2;
    seed ^= seed << 13, seed ^= seed >> 7, seed ^= seed << 17;
    for (int k = 0; k < 64; k += 16) sum += (double)((seed >> k) & 0xFFFF) / 65535;
    return sum * 1.7320508;
}

void go(enum state next)
{
    if (next != state) event("state %s", state_names[next]);
    if (next == CURRENT && state < CURRENT) heartbeat = tick;
    if (next == LIFT) moves[4].goal = LIFTED;
    state = next;
    since = tick;
    from_z = moves[4].now;
}

void land(enum state then)
{
    after = then;
    if (state != LANDING) go(LANDING);
}

void halt(void)
{
    moves[4].goal = moves[4].now;
    moves[5].goal = moves[5].now;
}

void inject(int axis, int sensor, double amplitude, double hz)
{
    sine.axis = axis, sine.sensor = sensor, sine.amplitude = amplitude, sine.hz = hz;
}

void heard_heartbeat(unsigned now)
{
    if (now != counter) heartbeat = tick;
    counter = now;
}

uint64_t heartbeat_age(void) { return state < CURRENT || state == FAULT ? UINT64_MAX / 1000 : tick - heartbeat; }

static void watch(void)
{
    if (state < CURRENT || state == FAULT || fault || heartbeat_age() < watchdog) return;
    fault = HEARTBEAT_LOST;
    tell("heartbeat %llu lost %llu %s", (unsigned long long)heartbeat, (unsigned long long)tick, state_names[state]);
    event("fault %s", fault_names[fault]);
    if (state == CURRENT) go(FAULT);
    else land(FAULT);
}

static void position(void)
{
    double part = (double)(tick - since) / TIMED, smooth = part * part * (3 - 2 * part);
    before_gamma = moves[5].now;
    if (state == LIFT) moves[4].now = from_z + (LIFTED - from_z) * smooth;
    if (state == LANDING) moves[4].now = from_z * (1 - smooth);
    for (int k = 0; k < 6 && state == LEVITATED; k++) {
        struct move *m = &moves[k];
        double left = m->goal - m->now, most = m->rate > 0 ? m->rate / TICKS : fabs(left);
        m->now += fmax(-most, fmin(most, left));
    }
    if (state == LIFT && tick - since >= TIMED) go(LEVITATED);
    else if (state == LANDING && tick - since >= TIMED) {
        go(after);
        if (state > CURRENT) tell("landed %llu %s", (unsigned long long)tick, state_names[state]);
    }
}

void plant_to(uint64_t target)
{
    while (tick < target) {
        tick++;
        for (int k = 0; k < CURRENTS; k++) {
            if (tick > step_ends[k]) step_of[k] = 0;
            double reference = state < CURRENT || state == FAULT ? 0 : step_of[k] + (state == LIFT || state == LEVITATED ? carrying[k] : 0);
            double y = current[k].value - reference, v = current[k].rate;
            current[k].value = reference + yy * y + yv * v;
            current[k].rate = vy * y + vv * v;
        }
        position();
        watch();
        capture_tick();
    }
}

double speed(void) { return (moves[5].now - before_gamma) * TICKS; }

static double coil(int k) /* roughly: torque currents turn with the phase, bearing currents the other way */
{
    int first = k < 6 ? 0 : k < 12 ? 4 : 8;
    double phase = M_PI * (k < 12 ? (k % 6) : 2 * (k % 3)) / 3;
    double value = current[first].value * cos(phase) - current[first + 1].value * sin(phase);
    if (first < 8) value += current[first + 2].value * cos(phase) + current[first + 3].value * sin(phase);
    return value;
}

static double sine_now(void) { return sine.amplitude * sin(2 * M_PI * fmod(sine.hz * (double)tick / TICKS, 1)); }

static double place(int axis)
{
    double value = moves[axis].now;
    if (axis < 4 && state != LEVITATED) value = state == LIFT ? 0 : axis < 2 ? 0 : RESTING;
    if (axis == sine.axis && sine.sensor) value += sine_now();
    if (axis < 4) return value + 0.15e-6 * noise();
    return axis == 4 ? value + 1e-6 * noise() : remainder(value + 30e-6 * noise(), 2 * M_PI);
}

double channel_value(int k)
{
    if (k < 15) return coil(k) + 3 * NOISE * noise();
    if (k < 30) return 1.8 * coil(k - 15) + 0.1 * noise();
    if (k < 45) return coil(k - 30) + NOISE * noise();
    if (k == 45) return SUPPLY + 0.1 * noise();
    if (k < 52) return place(k - 46);
    if (k >= 62) return 0; /* it injects nothing, and holds nothing */
    return current[k - 52].value + NOISE * noise();
}
