/* A controller for Levbench, written from docs/reference/protocol.md and nothing else: the proof that the page is enough.
 *
 *     firmware slcan|packets [FD]
 *
 * Speaks over the descriptor FD, or over a pseudo terminal of its own, whose path it prints. Ends when its standard
 * input does. Its plant levitates at once and spins up as told. C99 and POSIX, no dependencies. */
#define _XOPEN_SOURCE 600
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum { HEARTBEAT = 0x010, COMMAND, PARAM_SET, PARAM_GET, CLAIM, COMMAND_REPLY = 0x021, PARAM_REPLY, IDENTITY, OWNER, TELEMETRY = 0x100 };
enum { OFF, READY, LIFTING, LEVITATED, SPINNING, LANDING, COASTING, FAULT };
enum { DISABLE, ENABLE, LEVITATE, LAND, SPIN, STOP, CLEAR_FAULT, MAKE_SAFE, IDENTIFY, RELEASE };
enum { OK, UNKNOWN, OUT_OF_RANGE, WRONG_STATE, WRONG_SESSION };
enum { NO_FAULT = 0, HEARTBEAT_LOST = 4, PROTOCOL = 1, MAP_VERSION = 2, SERIAL = 4660, LIFT_MS = 20 };
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

static int port, packets;          /* the descriptor; packets rather than SLCAN */
static int64_t now, sign_of_life;  /* ticks of 100 us */
static int state, fault, armed, leaving, moving_ms; /* leaving: OFF when landed */
static uint32_t owner;
static uint8_t claimed[60];        /* since, name and spare of the owner's last Claim */
static int counter = -1;           /* of the owner's last heartbeat; -1: none yet */
static double speed, speed_target, angle;

static void send_message(int identifier, const uint8_t *payload, int length);

/* ---- numbers ---- */

static void put(uint8_t *at, uint32_t value, int bytes) { while (bytes--) { *at++ = (uint8_t)value; value >>= 8; } }
static uint32_t get(const uint8_t *at, int bytes) { uint32_t v = 0; while (bytes--) v = v << 8 | at[bytes]; return v; }
static void put_float(uint8_t *at, float value) { uint32_t raw; memcpy(&raw, &value, 4); put(at, raw, 4); }
static float get_float(const uint8_t *at) { uint32_t raw = get(at, 4); float v; memcpy(&v, &raw, 4); return v; }

static void put_scaled(uint8_t *at, double value, double scale, double low, double high) {
    double raw = floor(value / scale + 0.5);
    put(at, (uint32_t)(int32_t)(raw < low ? low : raw > high ? high : raw), 2);
}

/* ---- states, sessions, watchdog ---- */

static float *parameter(int index) {
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

static void release(void) { owner = 0; counter = -1; armed = 0; memset(claimed, 0, sizeof claimed); }

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

static void command(const uint8_t *m) {
    int code = m[4], status = code > RELEASE ? UNKNOWN : !takes(get(m, 4)) ? WRONG_SESSION : obey(code);
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

static void take_message(int identifier, const uint8_t *m, int length) {
    if (identifier == HEARTBEAT && length == 8) heartbeat(m);
    else if (identifier == COMMAND && length == 8) command(m);
    else if (identifier == PARAM_SET && length == 8) set_parameter(m);
    else if (identifier == PARAM_GET && length == 4) reply_parameter((int)get(m, 2), parameter((int)get(m, 2)) ? OK : UNKNOWN, m[2]);
    else if (identifier == CLAIM && length == 64) claim(m);
}

/* ---- plant and telemetry, a millisecond at a time ---- */

static void toward(double target, double step) { speed += target > speed + step ? step : target < speed - step ? -step : target - speed; }

static void millisecond(int64_t tick) {
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

static void telemetry(uint32_t tick) {
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

/* ---- output: whole lines and packets, or nothing of them ---- */

static uint8_t queue[65536];
static size_t queued;

static void enqueue(const uint8_t *bytes, size_t n) {
    if (queued + n > sizeof queue) return;
    memcpy(queue + queued, bytes, n);
    queued += n;
}

static void flush(void) {
    ssize_t n = queued ? write(port, queue, queued) : 0;
    if (n <= 0) return;
    queued -= (size_t)n;
    memmove(queue, queue + n, queued);
}

/* ---- transport: packets ---- */

static uint8_t content[1032];
static size_t filled = 7; /* bytes of content so far */

static uint32_t crc16(const uint8_t *in, size_t n) {
    uint32_t crc = 0xFFFF;
    while (n--) {
        crc ^= (uint32_t)*in++ << 8;
        for (int k = 0; k < 8; k++) crc = (crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1) & 0xFFFF;
    }
    return crc;
}

static uint32_t crc32(const uint8_t *in, size_t n) {
    uint32_t crc = 0xFFFFFFFF;
    while (n--) {
        crc ^= *in++;
        for (int k = 0; k < 8; k++) crc = crc & 1 ? crc >> 1 ^ 0xEDB88320 : crc >> 1;
    }
    return crc ^ 0xFFFFFFFF;
}

static size_t cobs_encode(const uint8_t *in, size_t n, uint8_t *out) {
    size_t code = 0, at = 1, i;
    for (i = 0; i < n; i++) {
        if (in[i]) out[at++] = in[i];
        if (!in[i] || (at - code == 255 && i + 1 < n)) { out[code] = (uint8_t)(at - code); code = at++; }
    }
    out[code] = (uint8_t)(at - code);
    return at;
}

static size_t cobs_decode(const uint8_t *in, size_t n, uint8_t *out) {
    size_t at = 0, i = 0;
    while (i < n) {
        size_t code = in[i], k;
        if (code == 0 || i + code > n) return 0;
        for (k = 1; k < code; k++) { if (in[i + k] == 0) return 0; out[at++] = in[i + k]; }
        i += code;
        if (code < 255 && i < n) out[at++] = 0;
    }
    return at;
}

static void close_packet(void) {
    static uint16_t sequence;
    uint8_t out[1040];
    if (filled == 7) return;
    content[0] = 1;
    put(content + 1, sequence++, 2);
    put(content + 3, (uint32_t)now, 4);
    size_t crc = filled <= 128 ? 2 : 4;
    put(content + filled, crc == 2 ? crc16(content, filled) : crc32(content, filled), (int)crc);
    size_t n = cobs_encode(content, filled + crc, out);
    out[n++] = 0;
    enqueue(out, n);
    filled = 7;
}

static void take_packet(uint8_t *p, size_t n) {
    n = cobs_decode(p, n, p);
    size_t crc = n <= 130 ? 2 : 4, size = n - crc, at;
    if (n < 12 || n == 131 || n == 132 || n > 1028) return;
    if (get(p + size, (int)crc) != (crc == 2 ? crc16(p, size) : crc32(p, size)) || p[0] != 1) return;
    for (at = 7; at < size; at += 3 + (size_t)p[at + 2])
        if (at + 3 > size || p[at + 1] > 7 || p[at + 2] > 64) return;
    if (at > size) return;
    for (at = 7; at < size; at += 3 + (size_t)p[at + 2]) take_message((int)get(p + at, 2), p + at + 3, p[at + 2]);
}

/* ---- transport: SLCAN, the adapter and its only node ---- */

static const int lengths[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
static int channel_open, stamped;

static void answer(const char *text) { enqueue((const uint8_t *)text, strlen(text)); }

static int digit(uint8_t c) { return c >= '0' && c <= '9' ? c - '0' : c >= 'A' && c <= 'F' ? c - 55 : c >= 'a' && c <= 'f' ? c - 87 : -1; }

static int take_frame(const uint8_t *s, size_t n) { /* whether the line is a frame */
    int extended = strchr("TDBR", s[0]) != NULL, remote = s[0] == 'r' || s[0] == 'R', fd = strchr("dDbB", s[0]) != NULL;
    size_t head = extended ? 10 : 5, k;
    uint32_t identifier = 0;
    uint8_t payload[64];
    if (n < head) return 0;
    for (k = 1; k < n; k++) if (digit(s[k]) < 0) return 0;
    for (k = 1; k < head - 1; k++) identifier = identifier << 4 | (uint32_t)digit(s[k]);
    int length = lengths[digit(s[head - 1])];
    if (identifier > (extended ? 0x1FFFFFFFu : 0x7FFu) || (!fd && length > 8)) return 0;
    if (n != head + (remote ? 0 : 2 * (size_t)length)) return 0;
    answer(extended ? "Z\r" : "z\r");
    if (extended || remote) return 1;
    for (int j = 0; j < length; j++) payload[j] = (uint8_t)(digit(s[head + 2 * j]) << 4 | digit(s[head + 2 * j + 1]));
    take_message((int)identifier, payload, length);
    return 1;
}

static void take_line(const uint8_t *s, size_t n) {
    int is_open = channel_open;
    const char *reply = "\a";
    if (n == 0) reply = "\r";
    else if (strchr("tTdDbBrR", s[0])) reply = is_open && take_frame(s, n) ? "" : "\a";
    else if (n == 1 && s[0] == 'C') { channel_open = 0; reply = "\r"; }
    else if (n == 1 && s[0] == 'O' && !is_open) { channel_open = 1; reply = "\r"; }
    else if (n == 1 && s[0] == 'F') reply = "F00\r";
    else if (n == 1 && s[0] == 'V') reply = "V1013\r";
    else if (n == 1 && s[0] == 'N') reply = "N0001\r";
    else if (n == 2 && !is_open && (!memcmp(s, "S8", 2) || !memcmp(s, "Y5", 2))) reply = "\r";
    else if (n == 2 && !is_open && s[0] == 'Z' && (s[1] == '0' || s[1] == '1')) { stamped = s[1] == '1'; reply = "\r"; }
    answer(reply);
}

static void send_message(int identifier, const uint8_t *payload, int length) {
    char line[160];
    int code = 0, at;
    if (packets) {
        if (filled + 3 + (size_t)length > 1024) close_packet();
        put(content + filled, (uint32_t)identifier, 2);
        content[filled + 2] = (uint8_t)length;
        memcpy(content + filled + 3, payload, (size_t)length);
        filled += 3 + (size_t)length;
        if (identifier != TELEMETRY) close_packet();
        return;
    }
    if (!channel_open) return;
    while (lengths[code] < length) code++;
    at = sprintf(line, "b%03X%X", identifier, code);
    for (int k = 0; k < length; k++) at += sprintf(line + at, "%02X", payload[k]);
    if (stamped) at += sprintf(line + at, "%04X", (unsigned)(now / 10 % 60000));
    line[at] = '\r';
    enqueue((uint8_t *)line, (size_t)at + 1);
}

/* ---- input ---- */

static void take_bytes(const uint8_t *in, size_t n) {
    static uint8_t unit[1100]; /* a line or packet that has not ended yet */
    static size_t length;
    size_t limit = packets ? 1033 : 142;
    for (size_t k = 0; k < n; k++) {
        if (in[k] != (packets ? 0 : '\r')) {
            if (length <= limit) unit[length++] = in[k];
            continue;
        }
        if (length > limit) { if (!packets) answer("\a"); }
        else if (packets) take_packet(unit, length);
        else take_line(unit, length);
        length = 0;
    }
}

static int own_terminal(void) {
    int fd = posix_openpt(O_RDWR | O_NOCTTY), slave;
    struct termios raw;
    if (fd < 0 || grantpt(fd) || unlockpt(fd) || (slave = open(ptsname(fd), O_RDWR | O_NOCTTY)) < 0) return -1;
    tcgetattr(slave, &raw);
    raw.c_iflag = 0; raw.c_oflag = 0; raw.c_lflag = 0;
    raw.c_cflag = (raw.c_cflag & ~(tcflag_t)(CSIZE | PARENB)) | CS8;
    tcsetattr(slave, TCSANOW, &raw);
    close(slave); /* from here on poll tells whether anybody has it open */
    printf("%s\n", ptsname(fd));
    fflush(stdout);
    return fd;
}

static int64_t elapsed_us(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

int main(int argc, char **argv) {
    if (argc < 2 || (strcmp(argv[1], "slcan") && strcmp(argv[1], "packets"))) {
        fputs("usage: firmware slcan|packets [FD]\n", stderr);
        return 2;
    }
    packets = !strcmp(argv[1], "packets");
    port = argc > 2 ? atoi(argv[2]) : own_terminal();
    if (port < 0 || fcntl(port, F_SETFL, fcntl(port, F_GETFL) | O_NONBLOCK)) { perror("firmware"); return 2; }
    int64_t start = elapsed_us(), ms = 0;
    int alone = 0; /* nobody has the terminal open */
    if (packets) enqueue((const uint8_t *)"", 1);
    for (;;) {
        uint8_t in[4096];
        struct pollfd fds[2] = {{0, POLLIN, 0}, {alone ? -1 : port, POLLIN, 0}};
        poll(fds, 2, 1);
        if (fds[0].revents && read(0, in, sizeof in) <= 0) return 0;
        now = (elapsed_us() - start) / 100;
        struct pollfd hung = {port, 0, 0};
        alone = poll(&hung, 1, 0) > 0 && hung.revents & POLLHUP;
        ssize_t n = read(port, in, sizeof in);
        if (n > 0) take_bytes(in, (size_t)n);
        else if (n == 0 && argc > 2) return 0;
        for (; ms < now / 10; ms++) {
            millisecond(10 * (ms + 1));
            telemetry((uint32_t)(10 * (ms + 1)));
            if (ms % 2) close_packet();
        }
        if (alone) queued = 0;
        flush();
    }
}
