/* The armband's behaviour on this computer, for tests where simavr is not installed. */
#include <string.h>

#include "band.h"
#include "lockstep.h"

static struct band band;
static struct band_ledger ledger; /* outlives a reset, as the board's does */
static uint64_t now_us;
static struct surroundings around = ROOM;
static int hangs;
static uint64_t hangs_until_us;

#define WATCHDOG_US 120000

static void measure(void) {
    band.battery_mv = (uint16_t)around.battery_mv;
    band.motor_mv = (uint16_t)around.motor_mv;
    band.die = (int16_t)around.die_centi_c;
    band.skin = band_skin_of((uint16_t)around.skin_reading);
}

void machine_start(const char *image, const char *bootloader) {
    (void)image, (void)bootloader;
    band_boot(&band, &ledger, 0, 1);
    measure();
}

void machine_run_to(uint64_t t_us) {
    uint8_t byte;
    now_us = t_us;
    if (hangs && now_us >= hangs_until_us) {
        hangs = 0;
        band_boot(&band, &ledger, (uint32_t)now_us, 8);
    }
    if (hangs) return;
    measure();
    band_step(&band, (uint32_t)now_us);
    while (band_next(&band, &byte)) host_takes(byte, now_us);
}

int machine_takes(void) { return 1; }

void machine_give(uint8_t byte) {
    if (!hangs) band_receive(&band, byte, (uint32_t)now_us);
}

void machine_duties(uint8_t duty[4]) { memcpy(duty, band.duty, 4); }

void machine_surroundings(const struct surroundings *now) { around = *now; }

void machine_hang(void) {
    hangs = 1;
    hangs_until_us = now_us + WATCHDOG_US;
}
