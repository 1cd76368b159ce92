/* line [--dialect] [--watchdog MS] pty | tcp PORT: the controller on a pseudo terminal or a socket. It prints where it listens, and
   each landing of its watchdog; it ends with its standard input. */
#define _XOPEN_SOURCE 600
#include "line.h"
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define ROOM (1024u * 1024)

static uint8_t queue[ROOM];
static size_t first, waiting;
static int listening = -1, wire = -1;

size_t out_room(void) { return ROOM - waiting; }

void out(const void *bytes, size_t length)
{
    const uint8_t *at = bytes;
    if (wire < 0 || length > out_room()) return; /* nobody hears it */
    for (size_t k = 0; k < length; k++) queue[(first + waiting++) % ROOM] = at[k];
}

void tell(const char *format, ...)
{
    va_list a;
    va_start(a, format);
    vprintf(format, a);
    va_end(a);
    puts("");
    fflush(stdout);
}

static void lost(void)
{
    if (listening < 0) return; /* a pseudo terminal waits for the next */
    close(wire);
    wire = -1;
    first = waiting = 0;
    shell_lost();
}

static void flush(void)
{
    while (waiting) {
        size_t piece = first + waiting > ROOM ? ROOM - first : waiting;
        ssize_t n = write(wire, queue + first, piece);
        if (n <= 0) return;
        first = (first + (size_t)n) % ROOM, waiting -= (size_t)n;
    }
}

static void open_pty(void)
{
    struct termios raw;
    wire = posix_openpt(O_RDWR | O_NOCTTY);
    if (wire < 0 || grantpt(wire) || unlockpt(wire)) exit(1);
    int slave = open(ptsname(wire), O_RDWR | O_NOCTTY); /* kept open, so that no host's end ends it */
    if (slave < 0 || tcgetattr(slave, &raw)) exit(1);
    raw.c_iflag = raw.c_oflag = raw.c_lflag = 0;
    raw.c_cflag |= CS8 | CREAD | CLOCAL;
    tcsetattr(slave, TCSANOW, &raw);
    fcntl(wire, F_SETFL, O_NONBLOCK);
    tell("%s", ptsname(wire));
}

static void open_tcp(int port)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    socklen_t length = sizeof address;
    int yes = 1;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    listening = socket(AF_INET, SOCK_STREAM, 0);
    setsockopt(listening, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (bind(listening, (struct sockaddr *)&address, sizeof address) || listen(listening, 1)) exit(1);
    getsockname(listening, (struct sockaddr *)&address, &length);
    tell("socket://127.0.0.1:%d", ntohs(address.sin_port));
}

static void accept_one(void)
{
    int yes = 1, next = accept(listening, NULL, NULL);
    if (next < 0) return;
    if (wire >= 0) lost();
    wire = next;
    setsockopt(wire, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    fcntl(wire, F_SETFL, O_NONBLOCK);
}

static uint64_t now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * TICKS + (uint64_t)t.tv_nsec * 7 / 25000;
}

static void hear(void)
{
    uint8_t bytes[512];
    ssize_t n = read(wire, bytes, sizeof bytes);
    if (n == 0) lost();
    for (ssize_t k = 0; k < n; k++) shell_byte(bytes[k]);
}

int main(int count, char **word)
{
    int at = 1;
    char ignored[64];
    signal(SIGPIPE, SIG_IGN);
    dialect = at < count && !strcmp(word[at], "--dialect") ? at++ : 0;
    if (at + 1 < count && !strcmp(word[at], "--watchdog")) {
        watchdog = (uint64_t)atoi(word[at + 1]) * TICKS / 1000;
        at += 2;
    }
    table_start();
    plant_start();
    if (at + 2 == count && !strcmp(word[at], "tcp")) open_tcp(atoi(word[at + 1]));
    else if (at + 1 == count && !strcmp(word[at], "pty")) open_pty();
    else return 2;
    shell_start();
    for (uint64_t start = now();;) {
        struct pollfd watched[3] = {{STDIN_FILENO, POLLIN, 0}, {listening, POLLIN, 0}, {wire, POLLIN, 0}};
        if (wire >= 0 && waiting) watched[2].events |= POLLOUT;
        poll(watched, 3, 1);
        if (watched[0].revents && read(STDIN_FILENO, ignored, sizeof ignored) <= 0) return 0;
        plant_to(now() - start);
        if (listening >= 0 && watched[1].revents & POLLIN) accept_one();
        else if (wire >= 0 && watched[2].revents & (POLLIN | POLLHUP | POLLERR)) hear();
        capture_send();
        if (wire >= 0) flush();
    }
}
