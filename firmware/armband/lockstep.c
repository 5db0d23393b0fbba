#include "lockstep.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define STEP_US 500
#define PTY_STEP_US 200
#define WAITING_BYTES 65536

static uint8_t waiting[WAITING_BYTES];
static uint32_t first, last;
static uint8_t shown[4];
static uint64_t at_us;
static int terminal = -1, is_cut;

static void fail(const char *what) {
    perror(what);
    exit(1);
}

static uint64_t host_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

void host_takes(uint8_t byte, uint64_t t_us) {
    if (terminal < 0)
        printf("X %llu %02x\n", (unsigned long long)t_us, byte);
    else if (!is_cut && write(terminal, &byte, 1) != 1 && errno != EAGAIN && errno != EIO)
        fail("write");
}

static void show_duties(int always) {
    uint8_t duty[4];
    machine_duties(duty);
    if (!always && memcmp(duty, shown, 4) == 0) return;
    memcpy(shown, duty, 4);
    printf("D %llu %llu %u %u %u %u\n", (unsigned long long)at_us, (unsigned long long)host_ns(),
           duty[0], duty[1], duty[2], duty[3]);
}

static void give_waiting(void) {
    while (first != last && machine_takes()) machine_give(waiting[first++ % WAITING_BYTES]);
}

static void run_to(uint64_t t_us, unsigned step_us) {
    while (at_us < t_us) {
        give_waiting();
        at_us = t_us - at_us > step_us ? at_us + step_us : t_us;
        machine_run_to(at_us);
        show_duties(0);
    }
}

static void obey(char *line) {
    unsigned long long t_us;
    struct surroundings around;
    int skip;
    if (sscanf(line, "B %llu %n", &t_us, &skip) == 1) {
        unsigned byte;
        run_to(t_us, STEP_US);
        for (char *hex = line + skip; sscanf(hex, "%2x", &byte) == 1; hex += 2)
            waiting[last++ % WAITING_BYTES] = (uint8_t)byte;
        give_waiting();
    } else if (sscanf(line, "T %llu", &t_us) == 1) {
        run_to(t_us, STEP_US);
        printf("K %llu\n", (unsigned long long)at_us);
        fflush(stdout);
    } else if (sscanf(line, "A %u %u %d %u", &around.battery_mv, &around.motor_mv,
                      &around.die_centi_c, &around.skin_reading) == 4) {
        machine_surroundings(&around);
    } else if (line[0] == 'H') {
        machine_hang();
    } else {
        fprintf(stderr, "unknown line: %s", line);
        exit(2);
    }
}

static void serve_terminal(void) {
    struct termios raw;
    terminal = posix_openpt(O_RDWR | O_NOCTTY);
    if (terminal < 0 || grantpt(terminal) || unlockpt(terminal)) fail("pty");
    int other = open(ptsname(terminal), O_RDWR | O_NOCTTY); /* held: it outlives its users */
    if (other < 0 || tcgetattr(other, &raw)) fail("pty");
    cfmakeraw(&raw);
    tcsetattr(other, TCSANOW, &raw);
    fcntl(terminal, F_SETFL, O_NONBLOCK);
    printf("P %s\n", ptsname(terminal));
    fflush(stdout);
    struct pollfd watched[2] = {{terminal, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
    uint64_t start_ns = host_ns();
    for (;;) {
        uint8_t bytes[256];
        uint64_t due_us = (host_ns() - start_ns) / 1000;
        if (due_us < at_us + PTY_STEP_US) {
            struct timespec nap = {0, (long)(at_us + PTY_STEP_US - due_us) * 1000};
            ppoll(watched, 2, &nap, NULL);
        } else if (poll(watched, 2, 0) < 0) {
            fail("poll");
        }
        if (watched[1].revents) { /* whoever started this has gone, or says stop */
            if (read(STDIN_FILENO, bytes, 1) <= 0) return;
            if (bytes[0] == 'H') machine_hang();
            if (bytes[0] == 'C') is_cut = 1; /* the cable: nothing passes any more */
            if (bytes[0] == 'Q') return;
        }
        if (watched[0].revents & POLLIN) {
            ssize_t n = read(terminal, bytes, sizeof bytes);
            if (is_cut) continue;
            for (ssize_t i = 0; i < n; i++) waiting[last++ % WAITING_BYTES] = bytes[i];
            if (n > 0)
                printf("R %llu %llu %zd\n", (unsigned long long)at_us,
                       (unsigned long long)host_ns(), n);
        }
        due_us = (host_ns() - start_ns) / 1000;
        if (due_us > at_us) run_to(due_us, PTY_STEP_US);
        fflush(stdout);
    }
}

int main(int argc, char **argv) {
    int on_terminal = argc > 1 && strcmp(argv[1], "--pty") == 0;
    char **images = argv + 1 + on_terminal; /* argv ends with a NULL */
    machine_start(images[0], images[0] ? images[1] : NULL);
    show_duties(1);
    if (on_terminal) {
        serve_terminal();
    } else {
        char line[8192];
        while (fgets(line, sizeof line, stdin)) obey(line);
    }
    return 0;
}
