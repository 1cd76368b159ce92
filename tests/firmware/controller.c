/* The controller of the example: numbers, states, sessions, watchdog, parameters, messages, plant and telemetry. */
#include "firmware.h"
#include <math.h>
#include <string.h>

static const double RAMP = 0.05, DRAG = 0.1; /* rad/s in a millisecond */

static struct { int index; float value, low, high; int resting; } parameters[] = {
    {1, 3, 0, 5, 1}, {2, 3, 0, 5, 1}, {3, 2, 0, 4, 1},
    {10, 42000, 0, 200000, 0}, {11, 42, 0, 2000, 0}, {12, 1e6f, 0, 1e7f, 0},
    {13, 43000, 0, 200000, 0}, {14, 175, 0, 2000, 0}, {15, 680000, 0, 1e7f, 0},
    {16, 20000, 0, 200000, 0}, {17, 60, 0, 2000, 0}, {18, 400000, 0, 1e7f, 0},
    {20, 0, -1e-4f, 1e-4f, 0}, {21, 0, -1e-4f, 1e-4f, 0}, {22, 0, -1e-4f, 1e-4f, 0}, {23, 0, -1e-4f, 1e-4f, 0},
    {24, 0, -1e-4f, 1e-4f, 0}, {30, 0, -10000, 10000, 0}, {31, 2, 0, 20, 0}, {32, 50, 0, 500, 0},
    {33, 1, 0, 50, 0}, {34, 100, 0, 2000, 0}, {35, 0, -70, 70, 0}, {40, 0, -10, 10, 0}, {41, 0, -10, 10, 0},
    {42, 0, -0.1f, 0.1f, 0}, {50, 0.08f, 0.02f, 1, 0}, {51, 5, 0.5f, 20, 0}, {52, 1, 0.2f, 5, 1}, {53, 12, 1, 12, 1},
};
enum { PARAMETERS = sizeof parameters / sizeof *parameters };

int64_t now;
static int64_t sign_of_life;       /* ticks of 100 us */
int state, fault;
static int armed, leaving, moving_ms; /* leaving: OFF when landed */
static uint32_t owner;
static uint8_t claimed[60];        /* since, name and spare of the owner's last Claim */
static uint8_t obeyed[8];          /* the owner's last Command; what comes again, byte for byte, is not executed again */
static int answered = -1;          /* and its status; -1: none yet */
static int counter = -1;           /* of the owner's last heartbeat; -1: none yet */
double speed, angle;
static double speed_target;

/* ---- numbers ---- */

void put(uint8_t *at, uint32_t value, int bytes) { while (bytes--) { *at++ = (uint8_t)value; value >>= 8; } }
uint32_t get(const uint8_t *at, int bytes) { uint32_t v = 0; while (bytes--) v = v << 8 | at[bytes]; return v; }
void put_float(uint8_t *at, float value) { uint32_t raw; memcpy(&raw, &value, 4); put(at, raw, 4); }
float get_float(const uint8_t *at) { uint32_t raw = get(at, 4); float v; memcpy(&v, &raw, 4); return v; }

void put_scaled(uint8_t *at, double value, double scale, double low, double high) {
    double raw = floor(value / scale + 0.5);
    put(at, (uint32_t)(int32_t)(raw < low ? low : raw > high ? high : raw), 2);
}

/* ---- states, sessions, watchdog ---- */

float *parameter(int index) {
    for (int k = 0; k < PARAMETERS; k++) if (parameters[k].index == index) return &parameters[k].value;
    return NULL;
}

static int at_rest(void) { return state == OFF || state == READY || state == FAULT; }

static void enter(int next) { state = next; moving_ms = 0; if (next == OFF || next == FAULT) armed = 0; }

static void set_down(void) {
    if (state == LEVITATED || state == SPINNING) enter(fabs(speed) > *parameter(51) ? COASTING : LANDING);
    else if (state == LIFTING) enter(LANDING);
    else if (state == READY || state == OFF) enter(fault ? FAULT : OFF);
}

static void release(void) { owner = 0; counter = -1; armed = 0; answered = -1; memset(claimed, 0, sizeof claimed); }

static int takes(uint32_t session) { /* whether a session owns the controller; takes it where it may */
    int gone = at_rest() && now - sign_of_life > 10000;
    if (!session || (owner && owner != session && !gone)) return 0;
    if (owner != session) { release(); owner = session; sign_of_life = now; }
    return 1;
}

static int obey(int code) {
    int levitated = state == LEVITATED || state == SPINNING;
    switch (code) {
    case DISABLE: if (state != OFF && state != READY) return WRONG_STATE; enter(OFF); return OK;
    case ENABLE: if (state != OFF) return WRONG_STATE; armed = 1; leaving = 0; sign_of_life = now; enter(READY); return OK;
    case LEVITATE: if (state != READY) return WRONG_STATE; enter(LIFTING); return OK;
    case LAND: if (state != LEVITATED) return WRONG_STATE; enter(LANDING); return OK;
    case SPIN: if (!levitated) return WRONG_STATE; speed_target = *parameter(35); return OK;
    case STOP: if (!levitated) return WRONG_STATE; speed_target = 0; return OK;
    case CLEAR_FAULT: if (state != FAULT) return WRONG_STATE; fault = NO_FAULT; enter(OFF); return OK;
    case MAKE_SAFE: leaving = 1; set_down(); return OK;
    case RELEASE: if (state != OFF && state != FAULT) return WRONG_STATE; release(); return OK;
    default: return OK; /* IDENTIFY */
    }
}

static int once(const uint8_t *m) { /* obey, unless it is the last Command again: then the status that it was given */
    if (m[4] != IDENTIFY && answered >= 0 && !memcmp(obeyed, m, 8)) return answered;
    int status = obey(m[4]);
    if (m[4] != IDENTIFY && m[4] != RELEASE) { answered = status; memcpy(obeyed, m, 8); }
    return status;
}

static void command(const uint8_t *m) {
    int code = m[4], status = code > RELEASE ? UNKNOWN : !takes(get(m, 4)) ? WRONG_SESSION : once(m);
    uint8_t reply[4] = {m[4], m[5], (uint8_t)status, (uint8_t)state}, identity[8];
    put(identity, PROTOCOL, 2); put(identity + 2, MAP_VERSION, 2); put(identity + 4, SERIAL, 4);
    if (code == IDENTIFY && status == OK) send_message(IDENTITY, identity, 8);
    send_message(COMMAND_REPLY, reply, 4);
}

static void claim(const uint8_t *m) {
    uint8_t reply[64];
    if (takes(get(m, 4))) memcpy(claimed, m + 4, 58);
    put(reply, owner, 4);
    memcpy(reply + 4, claimed, 60);
    send_message(OWNER, reply, 64);
}

static void heartbeat(const uint8_t *m) {
    if (!owner || get(m, 4) != owner || (int)get(m + 4, 2) == counter) return;
    counter = (int)get(m + 4, 2);
    sign_of_life = now;
}

static void reply_parameter(int index, int status, int token) {
    uint8_t reply[8];
    put(reply, (uint32_t)index, 2);
    reply[2] = (uint8_t)status;
    reply[3] = (uint8_t)token;
    put_float(reply + 4, parameter(index) ? *parameter(index) : 0);
    send_message(PARAM_REPLY, reply, 8);
}

static void set_parameter(const uint8_t *m) {
    int index = (int)get(m, 2), k = 0;
    float value = get_float(m + 2);
    while (k < PARAMETERS && parameters[k].index != index) k++;
    if (k == PARAMETERS) { reply_parameter(index, UNKNOWN, m[6]); return; }
    int status = !owner || m[7] != (owner & 0xFF) ? WRONG_SESSION
               : !(value >= parameters[k].low && value <= parameters[k].high) ? OUT_OF_RANGE
               : parameters[k].resting && state != OFF && state != READY ? WRONG_STATE : OK;
    if (status == OK) parameters[k].value = value;
    reply_parameter(index, status, m[6]);
}

void take_message(int identifier, const uint8_t *m, int length) {
    if (identifier == HEARTBEAT && length == 8) heartbeat(m);
    else if (identifier == COMMAND && length == 8) command(m);
    else if (identifier == PARAM_SET && length == 8) set_parameter(m);
    else if (identifier == PARAM_GET && length == 4) reply_parameter((int)get(m, 2), parameter((int)get(m, 2)) ? OK : UNKNOWN, m[2]);
    else if (identifier == CLAIM && length == 64) claim(m);
}

/* ---- plant and telemetry, a millisecond at a time ---- */

static void toward(double target, double step) { speed += target > speed + step ? step : target < speed - step ? -step : target - speed; }

void millisecond(int64_t tick) {
    moving_ms++;
    if (armed && state != OFF && state != FAULT && (double)(tick - sign_of_life) * 1e-4 > *parameter(50)) {
        if (!fault) fault = HEARTBEAT_LOST;
        armed = 0;
        set_down();
    }
    if (state == LEVITATED || state == SPINNING) {
        toward(speed_target, RAMP);
        state = fabs(speed) > *parameter(51) ? SPINNING : LEVITATED;
    } else {
        speed_target = 0;
        toward(0, DRAG);
    }
    if (state == LIFTING && moving_ms >= LIFT_MS) enter(LEVITATED);
    if (state == COASTING && fabs(speed) < *parameter(51)) enter(LANDING);
    if (state == LANDING && fabs(speed) > 1.1 * *parameter(51)) enter(COASTING); /* taken up again: something drives it */
    if (state == LANDING && moving_ms >= LIFT_MS) enter(fault ? FAULT : leaving ? OFF : READY);
    angle = remainder(angle + speed * 1e-3, 6.283185307179586);
}

void telemetry(uint32_t tick) {
    static uint16_t sequence;
    static const double coils[10] = {3, 3, 3.4, 2.6, 3, 3, 4, 2, 2, 2};
    uint8_t m[64] = {0};
    int up = state != OFF && state != READY && state != FAULT;
    int64_t age = (int64_t)tick - sign_of_life;
    put(m, sequence++, 2);
    put(m + 2, tick, 4);
    put_scaled(m + 8, up ? 0 : -200e-6, 2e-8, -32768, 32767);
    put_scaled(m + 12, up ? 0 : -200e-6, 2e-8, -32768, 32767);
    put_scaled(m + 16, angle, 6.283185307179586 / 65536, -32768, 32767);
    put_scaled(m + 18, speed, 0.005, -32768, 32767);
    for (int k = 0; up && k < 10; k++) put_scaled(m + 20 + 2 * k, coils[k], 0.0005, -32768, 32767);
    put_scaled(m + 48, 148, 0.01, 0, 65535);
    for (int k = 0; k < 3; k++) put_scaled(m + 50 + 2 * k, 295, 0.01, 0, 65535);
    put(m + 56, (uint32_t)state, 2);
    put(m + 58, (uint32_t)fault, 2);
    put(m + 60, armed ? 16 : 0, 2);
    put_scaled(m + 62, age < 0 ? 0 : (double)age * 1e-4, 0.001, 0, 65535);
    send_message(TELEMETRY, m, 64);
}
