/* A controller for Levbench, written from docs/reference/protocol.md and nothing else: the proof that the page is enough.
 *
 *     firmware slcan|packets [FD]
 *
 * Speaks over the descriptor FD, or over a pseudo terminal of its own, whose path it prints. Ends when its standard
 * input does. Its plant levitates at once and spins up as told. C99 and POSIX, no dependencies.
 * controller.c has the states and messages, wire.c the bytes. */
#define _XOPEN_SOURCE 600
#include "firmware.h"
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

static int port; /* the descriptor */

/* ---- output: whole lines and packets, or nothing of them ---- */

static uint8_t queue[65536];
static size_t queued;

void enqueue(const uint8_t *bytes, size_t n) {
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
