/* A board that is a process: for tests, and for computers that run Linux.
 *
 *   cell                 frames on standard input and output
 *   cell udp:PORT        frames in datagrams, answered to their sender
 *   cell unix:PATH       a socket; one host at a time
 *   cell pty             prints the name of a terminal that stands for a serial line
 */
#define _XOPEN_SOURCE 700

#include <fcntl.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "../link.h"

static int input = STDIN_FILENO, output = STDOUT_FILENO;
static struct sockaddr_in sender; /* of the newest datagram */
static socklen_t sender_size;     /* 0 unless frames are in datagrams */

const uint32_t board_tick_rate = 1000000000;

uint32_t board_ticks(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * board_tick_rate + (uint32_t)now.tv_nsec;
}

void board_send(const uint8_t *bytes, unsigned n)
{
    while (n > 0) {
        ssize_t written = sender_size > 0
            ? sendto(output, bytes, n, 0, (struct sockaddr *)&sender, sender_size)
            : write(output, bytes, n);
        if (written <= 0)
            return; /* the host has gone; it repeats its request when it is back */
        bytes += written;
        n -= (unsigned)written;
    }
}

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

static void open_udp(const char *port)
{
    sender.sin_family = AF_INET;
    sender.sin_addr.s_addr = htonl(INADDR_ANY);
    sender.sin_port = htons((uint16_t)atoi(port));
    input = output = socket(AF_INET, SOCK_DGRAM, 0);
    if (bind(input, (struct sockaddr *)&sender, sizeof sender) != 0)
        fail("udp");
    sender_size = sizeof sender;
}

static int listen_at(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int listening = socket(AF_UNIX, SOCK_STREAM, 0);
    strncpy(address.sun_path, path, sizeof address.sun_path - 1);
    unlink(path);
    if (bind(listening, (struct sockaddr *)&address, sizeof address) != 0 || listen(listening, 1))
        fail(path);
    return listening;
}

static void open_pty(void)
{
    struct termios raw;
    input = output = posix_openpt(O_RDWR | O_NOCTTY);
    if (input < 0 || grantpt(input) != 0 || unlockpt(input) != 0)
        fail("pty");
    int kept_open = open(ptsname(input), O_RDWR | O_NOCTTY); /* so that hosts may come and go */
    tcgetattr(kept_open, &raw);
    raw.c_iflag = raw.c_oflag = raw.c_lflag = 0;
    tcsetattr(kept_open, TCSANOW, &raw);
    puts(ptsname(input));
    fflush(stdout);
}

static ssize_t receive(uint8_t *bytes, size_t n)
{
    if (sender_size > 0)
        return recvfrom(input, bytes, n, 0, (struct sockaddr *)&sender, &sender_size);
    return read(input, bytes, n);
}

int main(int argc, char **argv)
{
    static uint8_t bytes[65536];
    const char *line = argc > 1 ? argv[1] : "";
    signal(SIGPIPE, SIG_IGN);
    int listening = strncmp(line, "unix:", 5) == 0 ? listen_at(line + 5) : -1;
    if (strncmp(line, "udp:", 4) == 0)
        open_udp(line + 4);
    else if (strcmp(line, "pty") == 0)
        open_pty();
    do {
        if (listening >= 0)
            input = output = accept(listening, NULL, NULL);
        for (ssize_t n; (n = receive(bytes, sizeof bytes)) > 0 || sender_size > 0;)
            for (ssize_t i = 0; i < n; i++)
                link_receive(bytes[i]);
        close(input);
    } while (listening >= 0);
    return 0;
}
