/* The bytes and the connection of the misbehaving controller.
 *
 *     mischief slcan|packets SEED K_I K_O [KIND[=VALUE][@START] ...]
 *
 * Listens on a free TCP port, which it prints. `hang KG` on standard input hangs a mass. Ends when standard input does, and then
 * prints its state, its fault, and for how long the computer let it stand still, s. */
#define _XOPEN_SOURCE 600
#include "mischief.h"
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { ROOM = 4 << 20 };
static uint8_t queue[ROOM];
static size_t queued;
static int client = -1;

static void append(const uint8_t *bytes, size_t n) {
    if (queued + n > ROOM) return;
    memcpy(queue + queued, bytes, n);
    queued += n;
}

static void append_noise(size_t n, int with_ends) {
    for (size_t k = 0; k < n; k++) {
        uint8_t byte = (uint8_t)uniform(0, 256);
        append((const uint8_t *)&(uint8_t){with_ends || byte ? byte : 1}, 1);
    }
}

/* a packet with another version or number, and its CRC right again */
static size_t renumbered(const uint8_t *in, size_t n, uint8_t *out, int version, uint16_t ahead) {
    uint8_t content[1100];
    size_t size = cobs_decode(in, n - 1, content), crc = size <= 130 ? 2 : 4;
    if (size < 12) return 0;
    size -= crc;
    if (version) content[0] = (uint8_t)version;
    put(content + 1, get(content + 1, 2) + ahead, 2);
    put(content + size, crc == 2 ? crc16(content, size) : crc32(content, size), (int)crc);
    n = cobs_encode(content, size + crc, out);
    out[n++] = 0;
    return n;
}

/* a whole packet or line on its way out */
void enqueue(const uint8_t *bytes, size_t n) {
    static uint16_t ahead;
    uint8_t unit[1100];
    const double *v;
    if (client < 0 || on("silent") || on("halfopen") || (n == 1 && packets)) return;
    memcpy(unit, bytes, n);
    if (!packets && n == 4 && unit[0] == 'F') { /* the answer to F */
        if (on("noF")) return;
        if ((v = on("statusF"))) sprintf((char *)unit, "F%02X\r", (unsigned)*v & 0xFF);
    }
    if (packets && once("packetseqjump")) ahead = (uint16_t)*on("packetseqjump");
    if (packets && (ahead || on("badversion"))) n = renumbered(bytes, n, unit, now_and_then("badversion") ? 2 : 0, ahead);
    if (n > 8 && now_and_then("crc")) unit[n / 2] ^= 0x10;
    if (n > 8 && now_and_then("flip")) unit[(size_t)uniform(0, (double)n)] ^= (uint8_t)(1 << (int)uniform(0, 8));
    if (n > 8 && now_and_then("badline")) unit[n / 2] = 'X';
    append(unit, n);
    if (now_and_then("huge2k")) { append_noise(2000, 0); append((const uint8_t *)"", 1); }
}

/* ---- the connection ---- */

static void hang_up(int reset) {
    struct linger at_once = {1, 0};
    if (client < 0) return;
    if (reset) setsockopt(client, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    close(client);
    client = -1;
    queued = 0;
}

static void flush(int64_t ms) {
    static int64_t held_until, sent;
    size_t most = queued;
    if (client < 0 || !queued) return;
    if (once("pause")) held_until = ms + (int64_t)(*on("pause") * 1e3);
    if (ms < held_until || on("halfopen")) return;
    if (on("slowloris")) { /* so many bytes a second */
        if (ms < sent + (int64_t)(1000 / *on("slowloris"))) return;
        sent = ms;
        most = 1;
    } else if (on("dribble")) {
        most = queued < 7 ? queued : 7;
        while (queued >= most && most && send(client, queue, most, MSG_NOSIGNAL) == (ssize_t)most) {
            queued -= most;
            memmove(queue, queue + most, queued);
        }
        return;
    }
    ssize_t n = send(client, queue, most, MSG_NOSIGNAL);
    if (n <= 0) return;
    queued -= (size_t)n;
    memmove(queue, queue + n, queued);
}

static void meddle(void) { /* with the connection as a whole */
    if (once("fin")) hang_up(0);
    if (once("rst")) hang_up(1);
    if (client >= 0 && once("halfclose")) shutdown(client, SHUT_WR);
    if (client >= 0 && once("huge")) append_noise((size_t)*on("huge"), 0);
    if (client >= 0 && on("garbage")) { queued = 0; append_noise((size_t)*on("garbage"), 1); }
}

static void greet(void) {
    int yes = 1;
    if (client < 0) return;
    setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    fcntl(client, F_SETFL, O_NONBLOCK);
    if (on("prefix")) append_noise((size_t)*on("prefix"), 1);
    if (packets) append((const uint8_t *)"", 1);
}

static int listening_port(void) {
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    if (fd < 0 || bind(fd, (struct sockaddr *)&at, size) || listen(fd, 4) || getsockname(fd, (struct sockaddr *)&at, &size)) return -1;
    fcntl(fd, F_SETFL, O_NONBLOCK);
    printf("%d\n", ntohs(at.sin_port));
    fflush(stdout);
    return fd;
}

static int64_t elapsed_us(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)((double)(t.tv_sec * 1000000 + t.tv_nsec / 1000) * (1 + (on("ppm") ? *on("ppm") * 1e-6 : 0)));
}

static int told(void) { /* what the operator did; 0 at the end */
    static char line[80];
    static size_t length;
    char in[80];
    ssize_t n = read(0, in, sizeof in);
    for (ssize_t k = 0; k < n; k++) {
        if (in[k] != '\n') { if (length < sizeof line - 1) line[length++] = in[k]; continue; }
        line[length] = 0;
        if (!strncmp(line, "hang ", 5)) hung_kg = atof(line + 5);
        length = 0;
    }
    return n > 0;
}

static void hear(void) {
    uint8_t in[4096];
    ssize_t n = client < 0 ? -1 : recv(client, in, sizeof in, 0);
    if (n == 0) hang_up(0);
    if (n > 0 && !on("halfopen")) take_bytes(in, (size_t)n);
}

int main(int argc, char **argv) {
    int64_t ms = 0, stalled = 0, start; /* stalled: the longest turn of the loop, ticks */
    if (argc < 5 || (strcmp(argv[1], "slcan") && strcmp(argv[1], "packets"))) return 2;
    packets = !strcmp(argv[1], "packets");
    make_rotor((unsigned)atoi(argv[2]), atof(argv[3]), atof(argv[4]));
    for (int k = 5; k < argc; k++) if (!switched(argv[k])) return 2;
    int door = listening_port(), bundle = on("bundle") ? (int)*on("bundle") : 2;
    if (door < 0) return 2;
    for (start = elapsed_us();;) {
        struct pollfd fds[3] = {{0, POLLIN, 0}, {client < 0 ? door : -1, POLLIN, 0}, {client, POLLIN, 0}};
        poll(fds, 3, 1);
        if (fds[0].revents && !told()) break;
        int64_t before = now;
        now = (elapsed_us() - start) / 100;
        if (now - before > stalled) stalled = now - before;
        if (client < 0 && (client = accept(door, NULL, NULL)) >= 0) greet();
        hear();
        for (; ms < now / 10; ms++) {
            millisecond(10 * (ms + 1));
            rotor_millisecond();
            late_messages(ms);
            telemetry((uint32_t)(10 * (ms + 1)));
            if (packets && ms % bundle == 0) close_packet();
            meddle();
        }
        flush(ms);
    }
    printf("state %d fault %d stalled %.2f\n", state, fault, (double)stalled * 1e-4);
    return 0;
}
