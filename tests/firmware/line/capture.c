/* Blocks, captures and slow telemetry. */
#include "line.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NONE, ARMED, RUNNING, DONE };
enum { NOW, STEP, LEVEL };

static uint8_t memory[MEMORY];
static struct {
    int state, trigger, source;
    unsigned number, every, width, list[CHANNELS];
    uint64_t mask, first_tick, total, start, length, before, at;
    double level, last;
    int fresh; /* no last value yet */
    uint32_t crc;
} c;
static struct { int open, tag, summed; uint32_t offset, end, blocks; } reading;
static unsigned stream_every;
static uint16_t sequence;

static uint32_t crc_on(uint32_t crc, const uint8_t *data, size_t length)
{
    static uint32_t table[256];
    for (uint32_t n = 0; !table[255] && n < 256; n++) {
        uint32_t v = n;
        for (int k = 0; k < 8; k++) v = v & 1 ? 0xEDB88320u ^ (v >> 1) : v >> 1;
        table[n] = v;
    }
    while (length--) crc = table[(crc ^ *data++) & 0xFF] ^ (crc >> 8);
    return crc;
}

static uint8_t *put(uint8_t *at, uint32_t value, int bytes)
{
    for (int k = 0; k < bytes; k++) *at++ = (uint8_t)(value >> 8 * k);
    return at;
}

void send_block(unsigned number, uint32_t offset, const uint8_t *data, unsigned length)
{
    uint8_t block[2 + 8 + 1024 + 4], *at = block;
    *at++ = 0xA5;
    *at++ = 0x5A;
    at = put(put(put(at, number, 2), offset, 4), length, 2);
    memcpy(at, data, length);
    at = put(at + length, ~crc_on(0xFFFFFFFFu, block + 2, length + 8), 4);
    out(block, (size_t)(at - block));
}

static uint16_t counts(double value, double scale)
{
    double n = floor(value / scale + 0.5);
    return (uint16_t)(int16_t)(n > 32767 ? 32767 : n < -32768 ? -32768 : n);
}

static void telemetry(void)
{
    uint8_t data[44], *at = put(data, sequence++, 2);
    static const double scale[6] = {1e-8, 1e-8, 1e-8, 1e-8, 1e-6, 6.283185307179586 / 65536};
    for (int k = 0; k < 6; k++) at = put(at, counts(channel_value(46 + k), scale[k]), 2);
    for (int k = 0; k < CURRENTS; k++) at = put(at, counts(channel_value(52 + k), 1e-3), 2);
    at = put(at, (uint32_t)(channel_value(45) * 100 + 0.5), 2);
    at = put(put(put(at, state, 1), (uint32_t)fault, 1), 0, 2);
    at = put(at, counts(speed(), 0.005), 2);
    uint64_t age = heartbeat_age() * 1000 / TICKS;
    put(at, age > 65535 ? 65535 : (uint32_t)age, 2);
    if (out_room() > 4096) send_block(dialect ? 0xFFFE : 0xFFFF, (uint32_t)tick, data, sizeof data);
}

void stream_set(unsigned hz) { stream_every = hz ? TICKS / hz : 0; }

static uint64_t bytes(void) { return c.length * c.width; }

static void done(void)
{
    uint64_t head = c.start % c.length * c.width;
    c.state = DONE;
    c.crc = ~crc_on(crc_on(0xFFFFFFFFu, memory + head, bytes() - head), memory, head);
    event("capture %u done", c.number);
}

static void triggered(uint64_t at)
{
    c.at = at < c.before ? at : c.before;
    c.start = at - c.at;
    c.state = RUNNING;
}

void capture_step(void)
{
    if (c.state == ARMED && c.trigger == STEP) triggered(c.total);
}

void capture_tick(void)
{
    if (stream_every && tick % stream_every == 0) telemetry();
    if ((c.state != ARMED && c.state != RUNNING) || tick % c.every) return;
    if (!c.total) c.first_tick = tick;
    uint8_t *at = memory + c.total % c.length * c.width;
    for (unsigned k = 0; k < c.width / 2; k++) {
        double value = channel_value((int)c.list[k]);
        at = put(at, counts(value, channels[c.list[k]].scale), 2);
        if (c.state != ARMED || c.trigger != LEVEL || (int)c.list[k] != c.source) continue;
        if (!c.fresh && c.last < c.level && value >= c.level) triggered(c.total);
        c.last = value, c.fresh = 0;
    }
    if (c.state == ARMED && c.trigger == NOW) triggered(c.total);
    c.total++;
    if (c.state == RUNNING && c.total - c.start == c.length) done();
}

static int trigger_of(int words, char **word)
{
    c.trigger = !strcmp(word[0], "now") ? NOW : !strcmp(word[0], "step") ? STEP : LEVEL;
    if (c.trigger != LEVEL) return words == 1;
    c.source = words == 3 && !strcmp(word[0], "level") ? channel_named(word[1]) : -1;
    return c.source >= 0 && (c.mask >> c.source & 1) && number_of(word[2], &c.level);
}

static void arm(int words, char **word)
{
    char *end = NULL;
    double rate, length, before;
    if (words < 5) { fail(ARGUMENTS, "MASK RATE LENGTH BEFORE now|step|level"); return; }
    c.mask = strtoull(word[0], &end, 16);
    int fine = !*end && number_of(word[1], &rate) && number_of(word[2], &length) && number_of(word[3], &before);
    if (!fine || !trigger_of(words - 4, word + 4)) { fail(ARGUMENTS, "MASK RATE LENGTH BEFORE now|step|level"); return; }
    unsigned n = 0;
    for (unsigned k = 0; k < CHANNELS; k++) if (c.mask >> k & 1) c.list[n++] = k;
    c.every = rate > 0 ? (unsigned)(TICKS / rate + 0.5) : 0;
    int known = rate == 35000 || rate == 140000 || rate == 280000;
    if (!n) { fail(RANGE, "channels 0..%d", CHANNELS - 1); return; }
    if (!known) { fail(RANGE, "35000|140000|280000"); return; }
    if ((n > 16 && c.every < 8) || length < 1 || before < 0 || before >= length || length * n * 2 > MEMORY) {
        fail(RANGE, "16 channels above 35000 Hz, %u bytes", MEMORY);
        return;
    }
    c.length = (uint64_t)length, c.before = (uint64_t)before, c.width = 2 * n;
    c.total = c.start = c.at = 0, c.fresh = 1, c.state = ARMED;
    c.number = c.number % (dialect ? 0xFFFD : 0xFFFE) + 1;
    reading.open = 0;
    ok("%u bytes=%llu", c.number, (unsigned long long)bytes());
}

static void status(void)
{
    static const char *const names[] = {"", "armed", "running", "done"};
    char sum[32] = "";
    if (c.state == NONE) { fail(NO_CAPTURE, ""); return; }
    if (c.state == DONE) snprintf(sum, sizeof sum, " %s=%u", word_of("crc"), (unsigned)c.crc);
    ok("%u %s %s=%llu %s=%llu %s=%llu %s=%llu %s=%u channels=%u%s", c.number, word_of(names[c.state]), word_of("bytes"),
       (unsigned long long)bytes(), word_of("samples"), (unsigned long long)(c.state == ARMED ? 0 : c.total - c.start),
       word_of("trigger"), (unsigned long long)c.at, word_of("tick"), (unsigned long long)(c.first_tick + c.start * c.every),
       word_of("every"), c.every, c.width / 2, sum);
}

static void sent(void)
{
    char text[40];
    snprintf(text, sizeof text, "cap sent=%u", (unsigned)reading.blocks);
    reading.open = 0;
    answer_later(reading.tag, reading.summed, text);
}

void capture_send(void)
{
    uint8_t piece[1024];
    if (reading.open && reading.offset >= reading.end) sent();
    while (reading.open && out_room() > 512u * 1024) {
        unsigned n = reading.end - reading.offset < 1024 ? reading.end - reading.offset : 1024;
        uint64_t head = c.start % c.length * c.width;
        for (unsigned k = 0; k < n; k++) piece[k] = memory[(head + reading.offset + k) % bytes()];
        send_block(c.number, reading.offset, piece, n);
        reading.offset += n, reading.blocks++;
        if (reading.offset == reading.end) sent();
    }
}

void verb_cap(int words, char **word)
{
    static const char *const names[] = {"", "armed", "running", "done"};
    double offset, length;
    const char *what = words ? word[0] : "";
    if (!strcmp(what, "arm")) arm(words - 1, word + 1);
    else if (!strcmp(what, "stat")) status();
    else if (!strcmp(what, "cancel")) {
        if (c.state == NONE) { fail(NO_CAPTURE, ""); return; }
        c.state = NONE, reading.open = 0;
        ok("");
    } else if (strcmp(what, "read") || words != 3 || !number_of(word[1], &offset) || !number_of(word[2], &length))
        fail(ARGUMENTS, "arm|stat|read|cancel");
    else if (c.state == NONE) fail(NO_CAPTURE, "");
    else if (c.state != DONE) fail(STATE, "%s", word_of(names[c.state]));
    else if (offset < 0 || length < 0) fail(ARGUMENTS, "OFFSET LENGTH");
    else {
        reading.offset = (uint32_t)offset, reading.end = (uint32_t)fmin(offset + length, (double)bytes()), reading.blocks = 0;
        reading.tag = current_tag(), reading.summed = current_summed(), reading.open = 1;
    }
}
