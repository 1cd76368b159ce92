/* The transports of the example: packets and SLCAN, out of and into messages. */
#include "firmware.h"
#include <stdio.h>
#include <string.h>

int packets;

/* ---- transport: packets ---- */

static uint8_t content[1032];
static size_t filled = 7; /* bytes of content so far */

uint32_t crc16(const uint8_t *in, size_t n) {
    uint32_t crc = 0xFFFF;
    while (n--) {
        crc ^= (uint32_t)*in++ << 8;
        for (int k = 0; k < 8; k++) crc = (crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1) & 0xFFFF;
    }
    return crc;
}

uint32_t crc32(const uint8_t *in, size_t n) {
    uint32_t crc = 0xFFFFFFFF;
    while (n--) {
        crc ^= *in++;
        for (int k = 0; k < 8; k++) crc = crc & 1 ? crc >> 1 ^ 0xEDB88320 : crc >> 1;
    }
    return crc ^ 0xFFFFFFFF;
}

size_t cobs_encode(const uint8_t *in, size_t n, uint8_t *out) {
    size_t code = 0, at = 1, i;
    for (i = 0; i < n; i++) {
        if (in[i]) out[at++] = in[i];
        if (!in[i] || (at - code == 255 && i + 1 < n)) { out[code] = (uint8_t)(at - code); code = at++; }
    }
    out[code] = (uint8_t)(at - code);
    return at;
}

size_t cobs_decode(const uint8_t *in, size_t n, uint8_t *out) {
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

void close_packet(void) {
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

void send_message(int identifier, const uint8_t *payload, int length) {
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

void take_bytes(const uint8_t *in, size_t n) {
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
