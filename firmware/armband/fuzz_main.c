/* Throw damaged bytes at the armband's behaviour and hold it to its promises.
 *
 * usage: armband_fuzz COUNT SEED. Each round sends a damaged command, then the host's refresh;
 * after the refresh the motors must do what the host wants, and duties never leave the allowed
 * range. One round in 64 sends a whole command that nobody meant, as damage that passes the check
 * would: there is too little of that to wait for.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "band.h"
#include "config.h"

#define ALL_STARTED_MS (3 * STAGGER_MS + 1)

static uint64_t state;

static uint32_t draw(uint32_t below) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (uint32_t)(state >> 32) % below;
}

static uint16_t crc_of(const uint8_t *data, size_t size) {
    uint16_t crc = 0xFFFF;
    while (size--) {
        crc ^= (uint16_t)(*data++ << 8);
        for (int bit = 0; bit < 8; bit++)
            crc = (uint16_t)(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
    }
    return crc;
}

/* A command with the zero that leads it and the one that ends it. */
static size_t frame(uint8_t *out, uint8_t kind, uint8_t seq, const uint8_t *payload) {
    uint8_t raw[16];
    size_t at = 2, mark = 1;
    raw[0] = kind;
    raw[1] = seq;
    memcpy(raw + 2, payload, 12);
    uint16_t crc = crc_of(raw, 14);
    raw[14] = (uint8_t)crc;
    raw[15] = (uint8_t)(crc >> 8);
    out[0] = 0;
    for (int i = 0; i < 16; i++) {
        if (raw[i]) {
            out[at++] = raw[i];
        } else {
            out[mark] = (uint8_t)(at - mark);
            mark = at++;
        }
    }
    out[mark] = (uint8_t)(at - mark);
    out[at++] = 0;
    return at;
}

static size_t damage(uint8_t *bytes, size_t size) {
    size_t at = 1 + draw((uint32_t)size - 1), run = 1 + draw(4);
    switch (draw(5)) {
    case 0:
        bytes[at] ^= (uint8_t)(1u << draw(8));
        return size;
    case 1:
        memmove(bytes + at, bytes + at + 1, size - at - 1);
        return size - 1;
    case 2:
        memmove(bytes + at + 1, bytes + at, size - at);
        bytes[at] = (uint8_t)(1 + draw(255)); /* a zero beside the ends would harm nothing */
        return size + 1;
    case 3:
        for (size_t i = at; i < size && i < at + run; i++) bytes[i] = (uint8_t)draw(256);
        return size;
    default:
        return at;
    }
}

static void send(struct band *band, const uint8_t *bytes, size_t size, uint32_t now_us) {
    uint8_t byte;
    for (size_t i = 0; i < size; i++) band_receive(band, bytes[i], now_us);
    while (band_next(band, &byte)) continue;
}

int main(int argc, char **argv) {
    long count = argc > 1 ? atol(argv[1]) : 100000;
    state = (argc > 2 ? strtoull(argv[2], NULL, 10) : 1) * 2654435769u + 88172645463325252u;
    struct band band;
    uint8_t bytes[64], payload[12], armed[12] = {1};
    uint32_t now_us = 0;
    long wrong = 0, survived = 0, forged = 0;
    const int lowest = DUTY_MIN, highest = DUTY_MAX;
    struct band_ledger ledger = {0};
    band_boot(&band, &ledger, 0, 1);
    band.battery_mv = 3900;
    band.motor_mv = 3300;
    band.die = 2500;
    send(&band, bytes, frame(bytes, 6, 1, armed), now_us);
    for (long round = 0; round < count; round++) {
        uint8_t seq = (uint8_t)(round * 2 + 2), before[4];
        uint8_t wanted = draw(2) ? (uint8_t)(1 + draw(255)) : 0;
        memcpy(before, band.duty, 4);
        memset(payload, 0, sizeof payload);
        payload[0] = (uint8_t)draw(256);
        payload[1] = (uint8_t)draw(40);
        for (int i = 2; i < 10; i++) payload[i] = (uint8_t)draw(256);
        size_t size = frame(bytes, (uint8_t)(2 + draw(5)), seq, payload);
        uint8_t intact[64];
        memcpy(intact, bytes, size);
        size_t damaged = damage(bytes, size);
        if (draw(64) == 0) {
            memcpy(bytes, intact, size);
            damaged = size;
            forged++;
        } else if (damaged == size && memcmp(bytes, intact, size) == 0) {
            continue;
        }
        send(&band, bytes, damaged, now_us);
        if (memcmp(before, band.duty, 4) && (band.duty[0] | band.duty[1] | band.duty[2] | band.duty[3]))
            wrong++;
        for (int i = 0; i < 4; i++)
            if (band.duty[i] && (band.duty[i] < lowest || band.duty[i] > highest)) {
                printf("{\"error\": \"duty %u out of range\"}\n", band.duty[i]);
                return 1;
            }
        send(&band, bytes, frame(bytes, 6, (uint8_t)(seq + 1), armed), now_us);
        memset(payload, 0, sizeof payload);
        if (wanted) { /* the refresh: SET with every motor, or a PING that expects silence */
            payload[1] = 1;
            for (int i = 0; i < 4; i++) payload[2 + 2 * i] = wanted;
        }
        send(&band, bytes, frame(bytes, wanted ? 2 : 5, (uint8_t)(seq + 1), payload), now_us);
        for (int ms = 0; ms < 50; ms++) {
            now_us += 1000;
            band_step(&band, now_us);
            if (ms != ALL_STARTED_MS) continue;
            for (int i = 0; i < 4; i++)
                if ((band.duty[i] != 0) != (wanted != 0)) survived++;
        }
    }
    printf("{\"frames\": %ld, \"forged\": %ld, \"wrong_until_refresh\": %ld, \"survived\": %ld}\n",
           count, forged, wrong, survived);
    return survived != 0;
}
