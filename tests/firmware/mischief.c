/* What the misbehaving controller hears and says. It stands between controller.c, which is that of the example, and the wire. */
#include "mischief.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SWITCHES = 8, HELD = 64 };
static struct { char kind[24]; double value; int64_t start; int done; } switches[SWITCHES];
static int count;
static struct { int64_t due; int identifier, length; uint8_t payload[64]; } held[HELD]; /* of slowreply */
static int64_t present; /* ms */
int64_t levitated_at = -1;

int switched(const char *text) {
    const char *value = strchr(text, '='), *start = strchr(text, '@');
    size_t n = strcspn(text, "=@");
    if (count == SWITCHES || n == 0 || n >= sizeof switches[0].kind) return 0;
    memcpy(switches[count].kind, text, n);
    switches[count].value = value ? atof(value + 1) : 1;
    switches[count].start = start ? (int64_t)(atof(start + 1) * 1e3) : -1;
    count++;
    return 1;
}

static int place(const char *kind) {
    for (int k = 0; k < count; k++) if (!strcmp(switches[k].kind, kind)) return k;
    return -1;
}

const double *on(const char *kind) {
    int k = place(kind);
    if (k < 0 || (switches[k].start >= 0 && (levitated_at < 0 || present < levitated_at + switches[k].start))) return NULL;
    return &switches[k].value;
}

int once(const char *kind) {
    int k = place(kind);
    if (!on(kind) || switches[k].done) return 0;
    return switches[k].done = 1;
}

double uniform(double low, double high) { /* xorshift: the same on every machine */
    static uint64_t x = 88172645463325252u;
    x ^= x << 13; x ^= x >> 7; x ^= x << 17;
    return low + (high - low) * (double)(x >> 11) / 9007199254740992.0;
}

double normal(double sigma) { double sum = -6; for (int k = 0; k < 12; k++) sum += uniform(0, 1); return sigma * sum; }

int now_and_then(const char *kind) { const double *share = on(kind); return share && uniform(0, 1) < *share; }

/* ---- what it hears ---- */

static int deaf(int identifier) {
    return (on("mute") && identifier != HEARTBEAT) || (on("deafheart") && identifier == HEARTBEAT)
        || (on("noclaim") && identifier == CLAIM) || (on("noparamget") && identifier == PARAM_GET)
        || (on("noparamset") && identifier == PARAM_SET) || (on("nocommand") && identifier == COMMAND);
}

void take_message(int identifier, const uint8_t *m, int length) {
    if (deaf(identifier)) return;
    if (on("disobey") && identifier == COMMAND && m[4] == *on("disobey")) { /* says yes, and does nothing */
        uint8_t reply[4] = {m[4], m[5], OK, (uint8_t)state};
        send_message(COMMAND_REPLY, reply, 4);
        return;
    }
    if (on("latefault") && identifier == COMMAND && m[4] == LAND) { /* levitation is lost on the way down */
        obey_message(identifier, m, length);
        fault = (int)*on("latefault");
        state = FAULT;
        return;
    }
    if (on("forgetful") && identifier == COMMAND) { /* spare bytes of its own, so that no Command is the last one again */
        static uint8_t many;
        uint8_t other[8];
        memcpy(other, m, 8);
        other[6] = ++many;
        obey_message(identifier, other, length);
        return;
    }
    obey_message(identifier, m, length);
}

/* ---- what it says ---- */

static void spoil_reply(int identifier, uint8_t *m) {
    const double *v;
    if (identifier == PARAM_REPLY) {
        if (on("nanreply")) put_float(m + 4, (float)NAN);
        if (on("wrongvalue")) put_float(m + 4, get_float(m + 4) + 0.04f);
        if (on("wrongtoken")) m[3]++;
        if ((v = on("badstatus"))) m[2] = (uint8_t)*v;
    } else if (identifier == COMMAND_REPLY) {
        if (on("cmdtoken")) m[1]++;
        if ((v = on("cmdstatus"))) m[2] = (uint8_t)*v;
        if ((v = on("cmdstate"))) m[3] = (uint8_t)*v;
    } else if (identifier == IDENTITY) {
        if (on("wrongproto")) put(m, 2, 2);
        if (on("wrongmap")) put(m + 2, 3, 2);
        if (on("serial0")) put(m + 4, 0, 4);
    } else if (identifier == OWNER) {
        if (on("otherowner")) { put(m, 0x01020304, 4); put(m + 4, 1767225600, 4); memset(m + 8, 0, 54); memcpy(m + 8, "nobody@else", 11); }
        if (on("badname")) { put(m, 0x01020304, 4); memset(m + 4, 0xFF, 58); memcpy(m + 8, "\033[31mred", 8); }
    }
}

static void move_counters(uint8_t *m) {
    static uint16_t sequence;
    static uint32_t tick, first_tick, first_sequence;
    static int32_t leap, ahead;
    if (once("reset")) { first_sequence = get(m, 2); first_tick = get(m + 2, 4) - 10; state = OFF; }
    if (once("seqjump")) leap += (int32_t)*on("seqjump");
    if (once("tickjump")) ahead += (int32_t)*on("tickjump");
    if (once("tickback")) ahead -= (int32_t)*on("tickback");
    if (!on("seqfrozen")) sequence = (uint16_t)(get(m, 2) - first_sequence + (uint32_t)leap);
    if (!on("tickfrozen")) tick = get(m + 2, 4) - first_tick + (uint32_t)ahead;
    put(m, sequence, 2);
    put(m + 2, tick, 4);
}

static void spoil_readings(uint8_t *m) {
    static uint8_t last[64];
    const double *v;
    if (levitated_at >= 0 && on("all_stuck")) memcpy(m + 6, last + 6, 58);
    if (on("stuck_yo_p")) memcpy(m + 32, last + 32, 2);
    if (on("stuck_pos_yo")) memcpy(m + 12, last + 12, 2);
    memcpy(last, m, 64);
    if ((v = on("gain_yo_p"))) put(m + 32, (uint32_t)(int32_t)(*v * (int16_t)get(m + 32, 2)), 2);
    if (now_and_then("glitch_i")) put(m + 24, 0, 2);
    if (now_and_then("currentneg")) put(m + 24, (uint32_t)-32768, 2);
    if (now_and_then("posextreme")) put(m + 8, 32767, 2);
    if (now_and_then("extreme")) for (int k = 0; k < 17; k++) put(m + 6 + 2 * k, k % 2 ? 32767 : (uint32_t)-32768, 2);
    if ((v = on("hotwinding"))) put_scaled(m + 50, *v, 0.01, 0, 65535);
    if ((v = on("badstate"))) put(m + 56, (uint32_t)*v, 2);
    if ((v = on("badfault"))) put(m + 58, (uint32_t)*v, 2);
    if ((v = on("badflags"))) put(m + 60, (uint32_t)*v, 2);
}

static void say_telemetry(uint8_t *m) {
    static uint8_t kept[64];
    static int keeping;
    rotor_readings(m);
    spoil_readings(m);
    move_counters(m);
    if (on("notelemetry") || now_and_then("drop")) return;
    if (now_and_then("hostspoof")) { uint8_t beat[8] = {0xAA, 0xBB, 0xCC, 0xDD, m[0], m[1]}; send_message(HEARTBEAT, beat, 8); }
    if (now_and_then("unknown")) send_message(0x7A1, m, 8);
    if (now_and_then("reorder") && !keeping) { memcpy(kept, m, 64); keeping = 1; return; }
    send_message(TELEMETRY, m, now_and_then("wronglength") ? 48 : 64);
    if (now_and_then("dup")) send_message(TELEMETRY, m, 64);
    if (keeping) { send_message(TELEMETRY, kept, 64); keeping = 0; }
}

void say_message(int identifier, const uint8_t *payload, int length) {
    uint8_t m[64];
    memcpy(m, payload, (size_t)length);
    if (identifier == TELEMETRY) { say_telemetry(m); return; }
    spoil_reply(identifier, m);
    static unsigned replies;
    if (on("lostreply") && ++replies % (unsigned)*on("lostreply") == 0) return; /* each so many */
    if (identifier == COMMAND_REPLY && m[0] == LEVITATE && once("lostlevitate")) return; /* executed, and not answered */
    if (on("slowreply")) {
        for (int k = 0; k < HELD; k++) if (!held[k].length) {
            held[k].due = present + (int64_t)(*on("slowreply") * 1e3);
            held[k].identifier = identifier;
            held[k].length = length;
            memcpy(held[k].payload, m, (size_t)length);
            return;
        }
    }
    send_message(identifier, m, length);
    if (on("dupreply")) send_message(identifier, m, length);
}

void late_messages(int64_t ms) {
    present = ms;
    if (levitated_at < 0 && state == LEVITATED) levitated_at = ms;
    for (int k = 0; k < HELD; k++) if (held[k].length && held[k].due <= ms) {
        send_message(held[k].identifier, held[k].payload, held[k].length);
        held[k].length = 0;
    }
}
