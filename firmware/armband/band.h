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

#define BAND_BINS 25 /* the current one and 24 that make up the window */
#define BAND_UNKNOWN INT16_MIN

/* For how long each motor was on, lately. The port keeps it where a reset leaves it as it is, so
 * that starting anew gives no time back. */
struct band_ledger {
    uint32_t magic, into_bin_us;
    uint16_t on_ms[BAND_BINS][BAND_MOTORS];
    uint8_t bin, on; /* `on`: a bit per motor that was on when it was last counted */
};

struct band {
    /* For the port to read: what the motors shall do. */
    uint8_t duty[BAND_MOTORS];

    /* For the port to write: what it measured. */
    uint16_t battery_mv, motor_mv; /* 0: unknown; the second at the motors' supply */
    int16_t die, skin;             /* hundredths of a degree Celsius; BAND_UNKNOWN */

    struct band_ledger *ledger;
    uint32_t counted_us, spent_ms[BAND_MOTORS];
    uint16_t counted_rest_us[BAND_MOTORS];
    uint8_t resting, still, starting; /* a bit per motor */
    uint8_t granted[BAND_MOTORS];     /* what a motor does once its turn to start has come */
    uint32_t turned_us[BAND_MOTORS], off_since_us[BAND_MOTORS], last_start_us, held_since_us;
    uint8_t held;

    uint8_t armed, running, low, hot, blind;
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
void band_boot(struct band *band, struct band_ledger *ledger, uint32_t now_us, uint8_t cause);

/* Temperature at the skin by the thermistor's divider, 1023 its supply; BAND_UNKNOWN if broken. */
int16_t band_skin_of(uint16_t reading);

/* Take one byte from the host. */
void band_receive(struct band *band, uint8_t byte, uint32_t now_us);

/* Let time pass: patterns move, what ran too long stops. Call at least every 2 ms. */
void band_step(struct band *band, uint32_t now_us);

/* Give the next byte for the host; 0 when there is none. */
uint8_t band_next(struct band *band, uint8_t *byte);

#endif
