/* Lines: tags, checksums, the reply that is kept, echo and prompt, events; a dialect with other words. */
#include "line.h"
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LONGEST 96
#define WORDS 16

int dialect;
struct mode mode = {1, 1, 0, 1};
static char line[LONGEST + 1], kept_request[LONGEST + 1], kept_reply[16384];
static size_t length, kept;
static int over, performing, tag = -1, summed, keeping, later;
static char waiting[16][64]; /* events of what is being performed: they stand behind its reply */
static int waiting_count;

static const char *const words_of_dialect[][2] = {
    {"armed", "waiting"}, {"running", "recording"}, {"done", "ready"}, {"bytes", "size"}, {"samples", "n"},
    {"trigger", "pre"}, {"tick", "t0"}, {"every", "div"}, {"crc", "sum"}, {"protocol", "proto"}, {"map", "ver"},
    {"serial", "sn"}, {"boot", "hello"}, {"lira firmware 1.0", "north firmware 1.0"}, {"lira> ", "north$ "},
};
static const char *const verbs_of_dialect[][3] = { /* verb, what it is called in the dialect, first argument */
    {"get", "rd", ""}, {"set", "wr", ""}, {"on", "go", "current"}, {"lift", "up", ""}, {"land", "dn", ""},
    {"stop", "off", ""}, {"hb", "beat", ""}, {"id", "who", ""}, {"stream", "tele", ""}, {"cap", "scope", "arm"},
    {"cap", "scope?", "stat"}, {"cap", "fetch", "read"}, {"cap", "drop", "cancel"},
};

const char *word_of(const char *word)
{
    for (int k = 0; dialect && k < COUNT(words_of_dialect); k++)
        if (!strcmp(words_of_dialect[k][0], word)) return words_of_dialect[k][1];
    return word;
}

static void send_line(const char *text, int with_sum)
{
    char whole[512];
    unsigned sum = 0;
    for (const char *at = text; *at; at++) sum ^= (unsigned char)*at;
    int n = with_sum || mode.checksum ? snprintf(whole, sizeof whole, "%s*%02X\r\n", text, sum)
                                      : snprintf(whole, sizeof whole, "%s\r\n", text);
    out(whole, (size_t)n);
    if (keeping && kept + (size_t)n < sizeof kept_reply) {
        memcpy(kept_reply + kept, whole, (size_t)n);
        kept += (size_t)n;
    }
}

static void reply(const char *mark, const char *format, va_list arguments)
{
    char text[400], head[24] = "-";
    if (tag >= 0) snprintf(head, sizeof head, "%d", tag);
    int n = snprintf(text, sizeof text, "%s %s ", head, mark);
    n += vsnprintf(text + n, sizeof text - (size_t)n, format, arguments);
    while (n && text[n - 1] == ' ') text[--n] = 0;
    send_line(text, summed);
    if (keeping) later = 0;
}

void ok(const char *format, ...)
{
    va_list a;
    va_start(a, format);
    reply("ok", format, a);
    va_end(a);
}

void more(const char *format, ...)
{
    va_list a;
    va_start(a, format);
    reply("+", format, a);
    va_end(a);
}

void fail(int code, const char *format, ...)
{
    static const char *const texts[] = {"", "unknown verb", "arguments", "range", "state", "busy", "checksum", "too long",
                                        "not owner", "hardware fault", "no capture"};
    char mark[40];
    va_list a;
    va_start(a, format);
    snprintf(mark, sizeof mark, "err %d %s", code + (dialect ? 20 : 0), texts[code]);
    reply(mark, format, a);
    va_end(a);
}

int current_tag(void) { return tag; }
int current_summed(void) { return summed; }

void answer_later(int asked, int with_sum, const char *text)
{
    int tag_now = tag, summed_now = summed, keeping_now = keeping;
    tag = asked, summed = with_sum;
    keeping = later && asked >= 0; /* nothing else has been asked since */
    ok("%s", text);
    tag = tag_now, summed = summed_now, keeping = keeping_now;
}

void event(const char *format, ...)
{
    char name[48], text[80];
    va_list a;
    va_start(a, format);
    vsnprintf(name, sizeof name, format, a);
    va_end(a);
    if (!mode.event) return;
    snprintf(text, sizeof text, "! %llu %s", (unsigned long long)tick, name);
    if (performing && waiting_count < COUNT(waiting)) snprintf(waiting[waiting_count++], sizeof waiting[0], "%.63s", text);
    else if (!performing) send_line(text, 0);
}

static void prompt(void)
{
    const char *text = word_of("lira> ");
    if (mode.prompt) out(text, strlen(text));
}

void shell_start(void)
{
    send_line(word_of("lira firmware 1.0"), 0);
    event("%s power", word_of("boot"));
    prompt();
}

static int value_of(char digit)
{
    const char *all = "0123456789ABCDEF0123456789abcdef", *at = strchr(all, digit);
    return digit && at ? (int)(at - all) % 16 : -1;
}

static int checked(void) /* takes the checksum off; -1: a wrong one */
{
    summed = 0;
    if (length < 3 || line[length - 3] != '*' || value_of(line[length - 2]) < 0 || value_of(line[length - 1]) < 0) return 0;
    unsigned sum = 0, said = (unsigned)(value_of(line[length - 2]) * 16 + value_of(line[length - 1]));
    for (size_t k = 0; k + 3 < length; k++) sum ^= (unsigned char)line[k];
    summed = 1;
    line[length -= 3] = 0;
    return sum == said ? 1 : -1;
}

static void translated(int words, char **word)
{
    char *order[WORDS + 1];
    for (int k = 0; dialect && k < COUNT(verbs_of_dialect); k++) {
        const char *const *row = verbs_of_dialect[k];
        if (!strcmp(word[0], row[1])) {
            order[0] = (char *)row[0];
            order[1] = (char *)row[2];
            int n = *row[2] ? 2 : 1;
            for (int j = 1; j < words; j++) order[n++] = word[j];
            if (!strcmp(row[1], "scope") && words >= 5) /* scope RATE LENGTH BEFORE MASK ... */
                order[2] = word[4], order[3] = word[1], order[4] = word[2], order[5] = word[3];
            perform(n, order);
            return;
        }
        if (!strcmp(word[0], row[0])) {
            fail(UNKNOWN_VERB, "%.60s", word[0]);
            return;
        }
    }
    perform(words, word);
}

static void spoken(char *text)
{
    char *word[WORDS];
    int words = 0;
    for (char *at = strtok(text, " "); at && words < WORDS; at = strtok(NULL, " ")) word[words++] = at;
    if (!words) fail(UNKNOWN_VERB, "");
    else translated(words, word);
}

static void take_tag(void)
{
    size_t n = strspn(line, "0123456789");
    tag = n >= 1 && n <= 4 && (line[n] == ' ' || !line[n]) ? atoi(line) : -1;
}

static void end_of_line(void)
{
    char request[LONGEST + 1];
    line[length] = 0;
    memcpy(request, line, length + 1);
    take_tag();
    if (tag >= 0 && !over && !strcmp(request, kept_request)) {
        out(kept_reply, kept);
        return;
    }
    int sum = checked();
    performing = 1;
    keeping = tag >= 0 && sum >= 0 && !over;
    if (keeping) kept = 0, later = 1, strcpy(kept_request, request);
    if (over || sum < 0) tag = -1, summed = 0; /* which tag it was nobody knows */
    if (over) fail(TOO_LONG, "");
    else if (sum < 0) fail(CHECKSUM, "");
    else spoken(tag < 0 ? line : line + strspn(line, "0123456789"));
    performing = keeping = 0;
    for (int k = 0; k < waiting_count; k++) send_line(waiting[k], 0);
    waiting_count = 0;
}

void shell_lost(void) { length = 0, over = 0; }

void shell_byte(uint8_t byte)
{
    if (byte == '\r') return;
    if (byte == '\n') {
        if (mode.echo) out("\r\n", 2);
        line[length] = 0;
        if (over || strspn(line, " ") < length) end_of_line();
        length = 0, over = 0;
        prompt();
    } else if (byte == 0x08 || byte == 0x7F) {
        if (length && mode.echo) out("\b \b", 3);
        if (length) length--;
    } else if (byte >= 0x20 && byte < 0x7F) {
        if (length < LONGEST) line[length++] = (char)byte;
        else over = 1;
        if (mode.echo) out(&byte, 1);
    }
}
