/* The armband's behaviour on this computer, for tests where simavr is not installed. */
#include <string.h>

#include "band.h"
#include "lockstep.h"

static struct band band;
static uint64_t now_us;
static unsigned battery_mv = 3900;
static int centi_c = 2500;
static int hangs;
static uint64_t hangs_until_us;

#define WATCHDOG_US 120000

void machine_start(const char *image) {
    (void)image;
    band_boot(&band, 0, 1);
}

void machine_run_to(uint64_t t_us) {
    uint8_t byte;
    now_us = t_us;
    if (hangs && now_us >= hangs_until_us) {
        hangs = 0;
        band_boot(&band, (uint32_t)now_us, 8);
    }
    if (hangs) return;
    band.battery_mv = (uint16_t)battery_mv;
    band.temperature = (int16_t)centi_c;
    band_step(&band, (uint32_t)now_us);
    while (band_next(&band, &byte)) host_takes(byte, now_us);
}

int machine_takes(void) { return 1; }

void machine_give(uint8_t byte) {
    if (!hangs) band_receive(&band, byte, (uint32_t)now_us);
}

void machine_duties(uint8_t duty[4]) { memcpy(duty, band.duty, 4); }

void machine_surroundings(unsigned mv, int temperature) {
    battery_mv = mv;
    centi_c = temperature;
}

void machine_hang(void) {
    hangs = 1;
    hangs_until_us = now_us + WATCHDOG_US;
}
