/* What each verb does. */
#include "line.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static unsigned rate_of_line = 115200;

int number_of(const char *text, double *value)
{
    char *end = NULL;
    *value = strtod(text, &end);
    return *text && strspn(text, "+-.0123456789eE") == strlen(text) && !*end && isfinite(*value);
}

void wrong_state(void) { fail(STATE, "state=%s", state_names[state]); }

static void id(int n, char **a)
{
    (void)n, (void)a;
    ok("model=north-1 %s=4711 fw=1.0 %s=1 %s=1", word_of("serial"), word_of("map"), word_of("protocol"));
}

static void stat(int n, char **a)
{
    (void)n, (void)a;
    ok("tick=%llu state=%s fault=%s sat=0 udc=%.9g", (unsigned long long)tick, state_names[state], fault_names[fault], channel_value(45));
}

static void meas(int n, char **a)
{
    int all = n == 1 && !strcmp(a[0], "all");
    if (!n) { fail(ARGUMENTS, "NAME..|all"); return; }
    for (int k = 0; !all && k < n; k++) if (channel_named(a[k]) < 0) { fail(ARGUMENTS, "unknown channel %.40s", a[k]); return; }
    int named = all ? CHANNELS : n;
    if (named > 1) more("tick=%llu", (unsigned long long)tick);
    for (int k = 0; k < named; k++) {
        struct channel *c = &channels[all ? k : channel_named(a[k])];
        double value = channel_value((int)(c - channels));
        if (named == 1) ok("tick=%llu %s=%.9g %s", (unsigned long long)tick, c->name, value, c->unit);
        else (k + 1 < named ? more : ok)("%s=%.9g %s", c->name, value, c->unit);
    }
}

static void list(int n, char **a)
{
    int par = n == 1 && !strcmp(a[0], "par");
    if (!par && (n != 1 || strcmp(a[0], "chan"))) { fail(ARGUMENTS, "par|chan"); return; }
    for (int k = 0; par && k < parameter_count; k++) {
        struct parameter *p = &parameters[k];
        more("%d %s %s f32 1 %.9g %.9g %.9g", k + 1, p->name, p->unit, p->low, p->high, p->delivered);
    }
    for (int k = 0; !par && k < CHANNELS; k++) more("%d %s %s i16 %.9g", k, channels[k].name, channels[k].unit, channels[k].scale);
    ok("%d", par ? parameter_count : CHANNELS);
}

static void get(int n, char **a)
{
    struct parameter *p = n == 1 ? parameter_named(a[0]) : NULL;
    if (p) ok("%s=%.9g %s", p->name, p->value, p->unit);
    else fail(ARGUMENTS, n == 1 ? "unknown parameter" : "NAME");
}

static void set(int n, char **a)
{
    double value;
    struct parameter *p = n == 2 ? parameter_named(a[0]) : NULL;
    if (!p || !number_of(a[1], &value)) fail(ARGUMENTS, n == 2 && !p ? "unknown parameter" : "NAME VALUE");
    else if (value < p->low || value > p->high) fail(RANGE, "%s %.9g..%.9g", p->name, p->low, p->high);
    else {
        p->value = (float)value;
        ok("%s=%.9g %s", p->name, p->value, p->unit);
    }
}

static void restore(int n, char **a)
{
    (void)n, (void)a;
    for (int k = 0; state <= IDLE && k < parameter_count; k++) parameters[k].value = (float)parameters[k].delivered;
    if (state <= IDLE) ok("");
    else wrong_state();
}

static void save(int n, char **a)
{
    (void)n, (void)a;
    for (int k = 0; state <= IDLE && k < parameter_count; k++) parameters[k].saved = parameters[k].value;
    if (state <= IDLE) ok("");
    else wrong_state();
}

static void enter(enum state next)
{
    go(next);
    ok("%s", state_names[state]);
}

static void on(int n, char **a)
{
    if (n != 1 || strcmp(a[0], "current")) fail(ARGUMENTS, "current");
    else if (state > IDLE) wrong_state();
    else enter(CURRENT);
}

static void lift(int n, char **a)
{
    (void)n, (void)a;
    if (state == CURRENT) enter(LIFT);
    else wrong_state();
}

static void set_down(int n, char **a)
{
    (void)n, (void)a;
    if (state != LIFT && state != LEVITATED) { wrong_state(); return; }
    land(CURRENT);
    ok("%s", state_names[state]);
}

static void stop(int n, char **a)
{
    (void)n, (void)a;
    if (state == FAULT) wrong_state();
    else enter(fault ? FAULT : IDLE);
}

static void safe(int n, char **a)
{
    (void)n, (void)a;
    if (state >= LIFT && state <= LANDING) land(fault ? FAULT : IDLE);
    else if (state == CURRENT) go(IDLE);
    ok("%s", state_names[state]);
}

static void stay(int n, char **a)
{
    (void)n, (void)a;
    halt();
    ok("%s", state_names[state]);
}

static void clear(int n, char **a)
{
    (void)n, (void)a;
    if (state != FAULT) { wrong_state(); return; }
    fault = 0;
    enter(IDLE);
}

static int axis_named(const char *name)
{
    for (int k = 0; k < 6; k++) if (!strcmp(name, axis_names[k])) return k;
    return -1;
}

static void ref(int n, char **a)
{
    static const double low[6] = {-5e-5, -5e-5, -5e-5, -5e-5, -1e-3, -10}, high[6] = {5e-5, 5e-5, 5e-5, 5e-5, 0.02, 10};
    double value, rate = 0, acceleration = 0;
    int k = n >= 2 ? axis_named(a[0]) : -1;
    if (k < 0 || n > 4 || !number_of(a[1], &value) || (n > 2 && !number_of(a[2], &rate)) ||
        (n > 3 && !number_of(a[3], &acceleration)))
        fail(ARGUMENTS, "AXIS VALUE [RATE ACCEL]");
    else if (state < CURRENT || state == FAULT) wrong_state();
    else if (value < low[k] || value > high[k]) fail(RANGE, "%s %.9g..%.9g", a[0], low[k], high[k]);
    else {
        moves[k].goal = value, moves[k].rate = rate;
        ok("%s=%.9g", a[0], value);
    }
}

static void step(int n, char **a)
{
    char name[12] = "i_";
    double value, seconds = 0;
    if (n == 2 || n == 3) strncat(name, a[0], 8);
    int k = n == 2 || n == 3 ? channel_named(name) - 52 : -1;
    if (k >= CURRENTS) k = -1;
    if (k < 0 || !number_of(a[1], &value) || (n == 3 && !number_of(a[2], &seconds))) fail(ARGUMENTS, "d_R1..q_L AMPERES [SECONDS]");
    else if (value < -5 || value > 5 || seconds < 0 || seconds > 1) fail(RANGE, "%s -5..5 0..1", a[0]);
    else if (state != CURRENT && state != LEVITATED) wrong_state();
    else {
        step_of[k] = value;
        step_ends[k] = seconds > 0 ? tick + (uint64_t)(seconds * TICKS + 0.5) : UINT64_MAX;
        capture_step();
        ok("%s=%.9g A", a[0], value);
    }
}

static void inj(int n, char **a)
{
    double amplitude, hz;
    if (n == 1 && !strcmp(a[0], "off")) {
        inject(-1, 0, 0, 0);
        ok("off");
        return;
    }
    if (n != 4 || axis_named(a[0]) < 0 || !number_of(a[2], &amplitude) || !number_of(a[3], &hz)) {
        fail(ARGUMENTS, "AXIS sensor|ref|force AMPLITUDE HZ or off");
        return;
    }
    inject(axis_named(a[0]), !strcmp(a[1], "sensor"), amplitude, hz);
    ok("%s %s %.9g %.9g", a[0], a[1], amplitude, hz);
}

static void hb(int n, char **a)
{
    double value;
    if (n != 1 || !number_of(a[0], &value)) { fail(ARGUMENTS, "COUNTER"); return; }
    heard_heartbeat((unsigned)value & 0xFFFF);
    ok("%s", a[0]);
}

static void stream(int n, char **a)
{
    double hz;
    if (n != 1 || !number_of(a[0], &hz)) fail(ARGUMENTS, "HZ");
    else if (hz < 0 || hz > 1000 || hz != floor(hz) || (hz > 0 && 35000 % (int)hz)) fail(RANGE, "a divisor of 35000, at most 1000");
    else {
        stream_set((unsigned)hz);
        ok("%s", a[0]);
    }
}

static void baud(int n, char **a)
{
    unsigned rate = n == 1 ? (unsigned)atoi(a[0]) : 0;
    if (rate != 115200 && rate != 921600 && rate != 3000000) fail(ARGUMENTS, "115200|921600|3000000");
    else if (state > IDLE) wrong_state();
    else {
        rate_of_line = rate; /* a pseudo terminal and a socket have none */
        ok("%u", rate_of_line);
    }
}

static int onoff(const char *verb, int n, char **a)
{
    const struct { const char *name; int *value; } switches[] = {
        {"echo", &mode.echo}, {"prompt", &mode.prompt}, {"checksum", &mode.checksum}, {"event", &mode.event}};
    for (int k = 0; k < COUNT(switches); k++) {
        if (strcmp(verb, switches[k].name)) continue;
        int yes = n == 1 && !strcmp(a[0], "on");
        if (!yes && (n != 1 || strcmp(a[0], "off"))) { fail(ARGUMENTS, "on|off"); return 1; }
        *switches[k].value = yes;
        ok("%s", a[0]);
        return 1;
    }
    return 0;
}

void perform(int words, char **word)
{
    static const struct { const char *name; void (*perform)(int, char **); } verbs[] = {
        {"id", id}, {"stat", stat}, {"meas", meas}, {"list", list}, {"get", get}, {"set", set}, {"default", restore},
        {"save", save}, {"on", on}, {"lift", lift}, {"land", set_down}, {"stop", stop}, {"safe", safe}, {"halt", stay},
        {"clear", clear}, {"ref", ref}, {"step", step}, {"inj", inj}, {"hb", hb}, {"cap", verb_cap}, {"stream", stream},
        {"baud", baud}};
    for (int k = 0; k < COUNT(verbs); k++)
        if (!strcmp(word[0], verbs[k].name)) {
            verbs[k].perform(words - 1, word + 1);
            return;
        }
    if (!onoff(word[0], words - 1, word + 1)) fail(UNKNOWN_VERB, "%.60s", word[0]);
}
