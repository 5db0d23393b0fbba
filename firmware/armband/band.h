/* The armband's behaviour, apart from any hardware: protocol, patterns, dead man, duties.
 *
 * The port feeds bytes and time and applies `duty`; times are microseconds that wrap at 2^32.
 * docs/armbands.md holds the table of messages.
 */
#ifndef ARMBAND_BAND_H
#define ARMBAND_BAND_H

#include <stdint.h>

#define BAND_MOTORS 4
#define BAND_FRAME_MAX 48
#define BAND_TX_BYTES 128 /* a power of two */

struct band {
    /* For the port to read: what the motors shall do. */
    uint8_t duty[BAND_MOTORS];

    /* For the port to write: what it measured. */
    uint16_t battery_mv;  /* 0: unknown */
    int16_t temperature;  /* hundredths of a degree Celsius; INT16_MIN: unknown */

    uint8_t armed, running, low, hot;
    uint8_t running_seq;
    uint8_t is_pattern;
    uint8_t amplitude[BAND_MOTORS], rate[BAND_MOTORS];
    uint8_t mask, pattern, low_hz, high_hz;
    uint16_t modulation_dhz, duration_ms;
    uint32_t started_us, until_us, fed_us;

    uint8_t has_last, last_kind, last_seq, last_size, event_seq;
    uint8_t last_answer[BAND_FRAME_MAX + 4];

    uint8_t frame[BAND_FRAME_MAX + 2], frame_size, frame_overlong;
    uint8_t tx[BAND_TX_BYTES], tx_head, tx_tail;
};

/* Start silent and disarmed, and say so; `cause` is what the port knows of the reset. */
void band_boot(struct band *band, uint32_t now_us, uint8_t cause);

/* Take one byte from the host. */
void band_receive(struct band *band, uint8_t byte, uint32_t now_us);

/* Let time pass: patterns move, what ran too long stops. Call at least every 2 ms. */
void band_step(struct band *band, uint32_t now_us);

/* Give the next byte for the host; 0 when there is none. */
uint8_t band_next(struct band *band, uint8_t *byte);

#endif
