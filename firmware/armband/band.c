#include "band.h"

#include <string.h>

#include "config.h"

#ifdef __AVR__
#include <avr/pgmspace.h>
#include <util/crc16.h>
#else
#define PROGMEM
#define pgm_read_byte(address) (*(address))
#define pgm_read_word(address) (*(address))
#endif

enum { HELLO = 1, SET = 2, PATTERN = 3, STOP = 4, PING = 5, ARM = 6, REPLY = 0x80, EVENT = 0xF0 };
enum { OK, NOT_ARMED, BAD_ARGUMENT, TOO_HOT, BATTERY_EMPTY, DISAGREED, RESTING, HELD, BLIND };
enum { STEADY, SINE, SQUARE, RAMP };
enum {
    BOOT = 1,
    DEAD_MAN,
    EXPIRED,
    LOW,
    GOOD,
    HOT,
    COOL,
    PATTERN_ENDED,
    RESTS,
    RESTED,
    HELD_TOO_LONG,
    SENSOR_LOST
};

#define VERSION 1
#define FIRMWARE_MAJOR 1
#define FIRMWARE_MINOR 1
#define COUPLED_DRIVE 1 /* capability: rate and amplitude share one drive per motor */
#define SKIN_IS_TOLD 2  /* capability: the temperature in answers is the skin's */
#define ALL_MOTORS ((1 << BAND_MOTORS) - 1)
#define BIN_US (WINDOW_MS * 1000UL / (BAND_BINS - 1))
#define BIN_MS (BIN_US / 1000)
#define HANG_MAX_MS 150 /* the watchdog's 120 ms by an oscillator that is 10 % off, and more */
#define LEDGER_MAGIC 0x5EA7BA2DUL
#define COMMAND_BYTES 12
#define ANSWER_BYTES 13
#define HELLO_BYTES 24
#define EVENT_BYTES 7

/* 127 sin(x) over the first quarter turn, 65 steps. */
static const uint8_t quarter_sine[65] PROGMEM = {
    0,   3,   6,   9,   12,  16,  19,  22,  25,  28,  31,  34,  37,  40,  43,  46,  49,
    51,  54,  57,  60,  63,  65,  68,  71,  73,  76,  78,  81,  83,  85,  88,  90,  92,
    94,  96,  98,  100, 102, 104, 106, 107, 109, 111, 112, 113, 115, 116, 117, 118, 120,
    121, 122, 122, 123, 124, 125, 125, 126, 126, 126, 127, 127, 127, 127};

/* Readings of the thermistor's divider (10 kOhm at 25 degrees and B 3380 K to ground, 10 kOhm to
 * the supply, 1023 steps) every 5 degrees from 0 to 60. */
static const uint16_t skin_readings[13] PROGMEM = {755, 709, 661, 611, 561, 512, 464, 418, 376, 337, 301, 268, 238};

static uint16_t crc_update(uint16_t crc, uint8_t byte) {
#ifdef __AVR__
    return _crc_xmodem_update(crc, byte);
#else
    crc ^= (uint16_t)byte << 8;
    for (uint8_t bit = 0; bit < 8; bit++)
        crc = (uint16_t)(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
    return crc;
#endif
}

static uint16_t crc_of(const uint8_t *data, uint8_t size) {
    uint16_t crc = 0xFFFF;
    while (size--) crc = crc_update(crc, *data++);
    return crc;
}

static uint16_t get16(const uint8_t *at) { return (uint16_t)(at[0] | (uint16_t)at[1] << 8); }

static void put16(uint8_t *at, uint16_t value) {
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

static void put32(uint8_t *at, uint32_t value) {
    put16(at, (uint16_t)value);
    put16(at + 2, (uint16_t)(value >> 16));
}

/* ---- towards the host ------------------------------------------------------------------- */

static void queue(struct band *band, const uint8_t *data, uint8_t size) {
    uint8_t used = (uint8_t)(band->tx_head - band->tx_tail) & (BAND_TX_BYTES - 1);
    if (size > BAND_TX_BYTES - 1 - used) return; /* whole messages or none */
    while (size--) {
        band->tx[band->tx_head] = *data++;
        band->tx_head = (band->tx_head + 1) & (BAND_TX_BYTES - 1);
    }
}

uint8_t band_next(struct band *band, uint8_t *byte) {
    if (band->tx_head == band->tx_tail) return 0;
    *byte = band->tx[band->tx_tail];
    band->tx_tail = (band->tx_tail + 1) & (BAND_TX_BYTES - 1);
    return 1;
}

/* Stuff `raw` (with room for the CRC behind it) into `out`; return the size of the frame. */
static uint8_t stuff(uint8_t *raw, uint8_t size, uint8_t *out) {
    put16(raw + size, crc_of(raw, size));
    size += 2;
    uint8_t mark = 0, at = 1;
    for (uint8_t i = 0; i < size; i++) {
        if (raw[i] == 0) {
            out[mark] = (uint8_t)(at - mark);
            mark = at++;
        } else {
            out[at++] = raw[i];
        }
    }
    out[mark] = (uint8_t)(at - mark);
    out[at++] = 0;
    return at;
}

static void tell(struct band *band, uint8_t code, uint32_t now_us, int16_t value) {
    uint8_t raw[2 + EVENT_BYTES + 2], out[2 + EVENT_BYTES + 4];
    raw[0] = EVENT;
    raw[1] = ++band->event_seq;
    raw[2] = code;
    put32(raw + 3, now_us);
    put16(raw + 7, (uint16_t)value);
    queue(band, out, stuff(raw, 2 + EVENT_BYTES, out));
}

static void welcome(struct band *band, uint8_t seq, uint32_t now_us) {
    uint8_t raw[2 + HELLO_BYTES + 2], out[2 + HELLO_BYTES + 4];
    memset(raw, 0, sizeof raw);
    raw[0] = HELLO | REPLY;
    raw[1] = seq;
    raw[2] = VERSION;
    raw[3] = BAND_MOTORS;
    raw[4] = FIRMWARE_MAJOR;
    raw[5] = FIRMWARE_MINOR;
    put16(raw + 6, COUPLED_DRIVE | (SKIN_SENSOR ? SKIN_IS_TOLD : 0));
    memcpy(raw + 8, SERIAL_NUMBER, sizeof SERIAL_NUMBER - 1 < 8 ? sizeof SERIAL_NUMBER - 1 : 8);
    put32(raw + 16, now_us);
    raw[20] = DUTY_MIN;
    raw[21] = DUTY_MAX;
    put16(raw + 22, RATE_MIN_HZ * 10);
    put16(raw + 24, RATE_MAX_HZ * 10);
    queue(band, out, stuff(raw, 2 + HELLO_BYTES, out));
}

static void answer(struct band *band, uint8_t kind, uint8_t seq, uint8_t status, uint32_t now_us) {
    uint8_t raw[2 + ANSWER_BYTES + 2];
    raw[0] = kind | REPLY;
    raw[1] = seq;
    put32(raw + 2, now_us);
    raw[6] = status;
    memcpy(raw + 7, band->granted, BAND_MOTORS);
    put16(raw + 11, band->battery_mv);
    put16(raw + 13, (uint16_t)(SKIN_SENSOR ? band->skin : band->die));
    band->last_size = stuff(raw, 2 + ANSWER_BYTES, band->last_answer);
    band->has_last = 1;
    band->last_kind = kind;
    band->last_seq = seq;
    queue(band, band->last_answer, band->last_size);
}

/* ---- how long the motors were on ---------------------------------------------------------- */

static void open_ledger(struct band *band) {
    struct band_ledger *ledger = band->ledger;
    if (ledger->magic != LEDGER_MAGIC || ledger->bin >= BAND_BINS) {
        memset(ledger, 0, sizeof *ledger);
        ledger->magic = LEDGER_MAGIC;
    }
    if (ledger->into_bin_us >= BIN_US) ledger->into_bin_us = 0;
    /* A program that hung left its motors on until the watchdog bit. */
    for (uint8_t motor = 0; motor < BAND_MOTORS; motor++)
        if (ledger->on >> motor & 1) ledger->on_ms[ledger->bin][motor] += HANG_MAX_MS;
    ledger->on = 0;
    for (uint8_t bin = 0; bin < BAND_BINS; bin++) {
        for (uint8_t motor = 0; motor < BAND_MOTORS; motor++) {
            uint16_t *on_ms = &ledger->on_ms[bin][motor];
            if (*on_ms > 2 * BIN_MS) *on_ms = 2 * BIN_MS; /* a reset cut its writing */
            band->spent_ms[motor] += *on_ms;
        }
    }
}

/* Add up to now what has been on; call before anything is switched. */
static void account(struct band *band, uint32_t now_us) {
    struct band_ledger *ledger = band->ledger;
    uint32_t elapsed_us = now_us - band->counted_us;
    band->counted_us = now_us;
    for (uint8_t motor = 0; motor < BAND_MOTORS; motor++) {
        if (!band->duty[motor]) continue;
        uint32_t on_us = band->counted_rest_us[motor] + elapsed_us;
        while (on_us >= 1000) {
            on_us -= 1000;
            ledger->on_ms[ledger->bin][motor]++;
            band->spent_ms[motor]++;
        }
        band->counted_rest_us[motor] = (uint16_t)on_us;
    }
    ledger->into_bin_us += elapsed_us;
    while (ledger->into_bin_us >= BIN_US) {
        ledger->into_bin_us -= BIN_US;
        ledger->bin = (uint8_t)((ledger->bin + 1) % BAND_BINS);
        for (uint8_t motor = 0; motor < BAND_MOTORS; motor++) {
            uint16_t *on_ms = &ledger->on_ms[ledger->bin][motor];
            band->spent_ms[motor] -= *on_ms;
            *on_ms = 0;
        }
    }
}

/* ---- the motors ------------------------------------------------------------------------- */

static void silence(struct band *band) {
    band->running = band->ledger->on = 0;
    memset(band->duty, 0, BAND_MOTORS);
    memset(band->granted, 0, BAND_MOTORS);
}

/* Silence because the host asks for it: the same setting may come again. */
static void release(struct band *band) {
    silence(band);
    band->held = 0;
}

static uint8_t duty_of_rate(uint8_t rate_hz) {
    if (rate_hz < RATE_MIN_HZ) rate_hz = RATE_MIN_HZ;
    if (rate_hz > RATE_MAX_HZ) rate_hz = RATE_MAX_HZ;
    uint16_t over = (uint16_t)(rate_hz - RATE_MIN_HZ) * (DUTY_MAX - DUTY_MIN);
    const uint8_t span = RATE_MAX_HZ - RATE_MIN_HZ;
    return (uint8_t)(DUTY_MIN + (over + span / 2) / span);
}

static uint8_t duty_of_level(uint8_t low, uint8_t high, uint8_t level) {
    return (uint8_t)(low + ((uint16_t)(high - low) * level + 127) / 255);
}

/* 0..255 over one turn of 256 steps, beginning at the middle and rising. */
static uint8_t sine_level(uint8_t turn) {
    uint8_t at = turn & 63;
    if (turn & 64) at = 64 - at;
    uint8_t height = pgm_read_byte(&quarter_sine[at]);
    return turn & 128 ? 127 - height : 128 + height;
}

static uint8_t pattern_duty(const struct band *band, uint32_t now_us) {
    uint32_t elapsed_us = now_us - band->started_us;
    uint8_t low = duty_of_rate(band->low_hz), high = duty_of_rate(band->high_hz);
    /* At most 2 s and 50 Hz: the product stays below 2^30. */
    uint8_t turn = (uint8_t)(elapsed_us * band->modulation_dhz % 10000000UL / 39063UL);
    switch (band->pattern) {
    case SINE:
        return duty_of_level(low, high, sine_level(turn));
    case SQUARE:
        return turn & 128 ? 0 : high;
    case RAMP:
        return duty_of_level(low, high, (uint8_t)(elapsed_us / 1000 * 255 / band->duration_ms));
    default:
        return high;
    }
}

/* The highest duty whose mean voltage the motors bear. */
static uint8_t highest_duty(const struct band *band) {
    uint16_t supply_mv = band->motor_mv ? band->motor_mv : MOTOR_WORST_MV;
    if (supply_mv <= MOTOR_MAX_MV) return 255;
    return (uint8_t)(255UL * MOTOR_MAX_MV / supply_mv);
}

/* Let motors that stand still start one after the other; return what each may do now. */
static void take_turns(struct band *band, uint32_t now_us, uint8_t *duty) {
    for (uint8_t motor = 0; motor < BAND_MOTORS; motor++) {
        uint8_t bit = (uint8_t)(1 << motor);
        if (band->starting & bit && now_us - band->turned_us[motor] >= START_MS * 1000UL)
            band->starting &= (uint8_t)~bit;
        if (!duty[motor] || !(band->still & bit)) continue;
        if (band->starting && now_us - band->last_start_us < STAGGER_MS * 1000UL) {
            duty[motor] = 0;
            continue;
        }
        band->still &= (uint8_t)~bit;
        band->starting |= bit;
        band->turned_us[motor] = band->last_start_us = now_us;
    }
}

/* Weaken all alike when together they would take more than the supply gives. */
static void share_current(const struct band *band, uint8_t *duty) {
    uint32_t taken = 0;
    const uint32_t given = CURRENT_MAX_MA * 255UL;
    for (uint8_t motor = 0; motor < BAND_MOTORS; motor++)
        taken += (uint32_t)duty[motor] *
                 (band->starting >> motor & 1 ? MOTOR_START_MA : MOTOR_RUN_MA);
    if (taken <= given) return;
    for (uint8_t motor = 0; motor < BAND_MOTORS; motor++)
        duty[motor] = (uint8_t)(duty[motor] * given / taken);
}

static void drive(struct band *band, uint32_t now_us) {
    uint8_t duty = band->is_pattern ? pattern_duty(band, now_us) : 0;
    uint8_t highest = highest_duty(band), asked;
    for (uint8_t motor = 0; motor < BAND_MOTORS; motor++) {
        if (band->is_pattern)
            asked = band->mask >> motor & 1 ? duty : 0;
        else if (!band->amplitude[motor])
            asked = 0;
        else if (band->rate[motor])
            asked = duty_of_rate(band->rate[motor]);
        else
            asked = duty_of_level(DUTY_MIN, DUTY_MAX, band->amplitude[motor]);
        if (band->resting >> motor & 1) asked = 0;
        band->granted[motor] = asked > highest ? highest : asked;
    }
    uint8_t now[BAND_MOTORS];
    memcpy(now, band->granted, BAND_MOTORS);
    take_turns(band, now_us, now);
    share_current(band, now);
    memcpy(band->duty, now, BAND_MOTORS);
    band->ledger->on = 0;
    for (uint8_t motor = 0; motor < BAND_MOTORS; motor++)
        if (now[motor]) band->ledger->on |= (uint8_t)(1 << motor);
}

/* Why nothing may run; `motors` are asked for, a bit each. */
static uint8_t refusal(const struct band *band, uint8_t motors) {
    if (!band->armed) return NOT_ARMED;
    if (band->blind) return BLIND;
    if (band->hot) return TOO_HOT;
    if (band->battery_mv && band->battery_mv < BATTERY_EMPTY_MV) return BATTERY_EMPTY;
    if (!(motors & ~band->resting)) return RESTING;
    return OK;
}

static void run(struct band *band, uint8_t seq, uint32_t now_us, uint32_t for_us) {
    band->running = 1;
    band->running_seq = seq;
    band->started_us = now_us;
    band->until_us = now_us + for_us;
    drive(band, now_us);
}

/* ---- commands --------------------------------------------------------------------------- */

static uint8_t set(struct band *band, uint8_t seq, const uint8_t *at, uint32_t now_us) {
    uint16_t ttl_ms = get16(at);
    uint8_t motors = 0, same = !band->is_pattern;
    uint32_t held_us = 0, for_us = ttl_ms * 1000UL;
    if (ttl_ms < 1 || ttl_ms > TTL_MAX_MS) return BAD_ARGUMENT;
    for (uint8_t motor = 0; motor < BAND_MOTORS; motor++) {
        uint8_t amplitude = at[2 + 2 * motor], rate = at[3 + 2 * motor];
        if (amplitude) motors |= (uint8_t)(1 << motor);
        if (amplitude != band->amplitude[motor] || rate != band->rate[motor]) same = 0;
    }
    if (!motors) {
        release(band);
        return OK;
    }
    uint8_t status = refusal(band, motors);
    if (status != OK) return status;
    if (same && band->held) return HELD;
    if (same && band->running)
        held_us = now_us - band->held_since_us;
    else
        band->held_since_us = now_us;
    if (held_us >= HOLD_MAX_MS * 1000UL) return HELD; /* its end is a step away */
    if (for_us > HOLD_MAX_MS * 1000UL - held_us) for_us = HOLD_MAX_MS * 1000UL - held_us;
    for (uint8_t motor = 0; motor < BAND_MOTORS; motor++) {
        band->amplitude[motor] = at[2 + 2 * motor];
        band->rate[motor] = at[3 + 2 * motor];
    }
    band->is_pattern = band->held = 0;
    run(band, seq, now_us, for_us);
    return OK;
}

static uint8_t play(struct band *band, uint8_t seq, const uint8_t *at, uint32_t now_us) {
    uint8_t mask = at[0], low = at[3], high = at[4];
    uint16_t modulation = get16(at + 5), duration = get16(at + 7);
    if (!mask || mask >> BAND_MOTORS || at[1] > RAMP || !at[2] || low < RATE_MIN_HZ ||
        high > RATE_MAX_HZ || low > high || modulation < 1 || modulation > 500 || duration < 1 ||
        duration > PATTERN_MAX_MS)
        return BAD_ARGUMENT;
    uint8_t status = refusal(band, mask);
    if (status != OK) return status;
    band->mask = mask;
    band->pattern = at[1];
    band->low_hz = low;
    band->high_hz = high;
    band->modulation_dhz = modulation;
    band->duration_ms = duration;
    band->is_pattern = 1;
    band->held = 0;
    run(band, seq, now_us, duration * 1000UL);
    return OK;
}

static uint8_t ping(struct band *band, const uint8_t *at) {
    if (!band->running || (at[0] && at[1] == band->running_seq)) return OK;
    silence(band);
    return DISAGREED;
}

static uint8_t used_bytes(uint8_t kind) {
    switch (kind) {
    case HELLO:
    case ARM:
        return 1;
    case SET:
        return 10;
    case PATTERN:
        return 9;
    case PING:
        return 2;
    case STOP:
        return 0;
    default:
        return 0xFF;
    }
}

static void obey(struct band *band, const uint8_t *raw, uint8_t size, uint32_t now_us) {
    uint8_t kind = raw[0], seq = raw[1], status = OK, used = used_bytes(kind);
    const uint8_t *at = raw + 2;
    if (used == 0xFF || size != 2 + COMMAND_BYTES) return;
    for (uint8_t i = used; i < COMMAND_BYTES; i++)
        if (at[i]) return;
    band->fed_us = now_us;
    account(band, now_us);
    if (kind == HELLO) {
        release(band);
        band->armed = band->has_last = 0;
        welcome(band, seq, now_us);
        return;
    }
    if (kind != STOP && band->has_last && band->last_kind == kind && band->last_seq == seq) {
        queue(band, band->last_answer, band->last_size); /* heard before: done once only */
        return;
    }
    switch (kind) {
    case SET:
        status = set(band, seq, at, now_us);
        break;
    case PATTERN:
        status = play(band, seq, at, now_us);
        break;
    case STOP:
        release(band);
        break;
    case PING:
        status = ping(band, at);
        break;
    case ARM:
        if (at[0] > 1) {
            status = BAD_ARGUMENT;
            break;
        }
        band->armed = at[0];
        if (!band->armed) release(band);
        break;
    }
    answer(band, kind, seq, status, now_us);
}

/* Undo the stuffing in place; return the size, or 0 when the bytes are no frame. */
static uint8_t unstuff(uint8_t *data, uint8_t size) {
    uint8_t from = 0, to = 0;
    while (from < size) {
        uint8_t skip = data[from];
        if (skip == 0 || skip > size - from) return 0;
        for (uint8_t i = 1; i < skip; i++) data[to++] = data[from + i];
        from += skip;
        if (from < size) data[to++] = 0;
    }
    return to;
}

void band_receive(struct band *band, uint8_t byte, uint32_t now_us) {
    if (byte) {
        if (band->frame_size < sizeof band->frame)
            band->frame[band->frame_size++] = byte;
        else
            band->frame_overlong = 1;
        return;
    }
    uint8_t size = band->frame_overlong ? 0 : unstuff(band->frame, band->frame_size);
    band->frame_size = band->frame_overlong = 0;
    if (size < 4 || size > BAND_FRAME_MAX) return;
    if (crc_of(band->frame, size - 2) != get16(band->frame + size - 2)) return;
    obey(band, band->frame, size - 2, now_us);
}

/* ---- time ------------------------------------------------------------------------------- */

void band_boot(struct band *band, struct band_ledger *ledger, uint32_t now_us, uint8_t cause) {
    memset(band, 0, sizeof *band);
    band->die = band->skin = BAND_UNKNOWN;
    band->still = ALL_MOTORS;
    band->fed_us = band->counted_us = now_us;
    band->ledger = ledger;
    open_ledger(band);
    tell(band, BOOT, now_us, cause);
}

int16_t band_skin_of(uint16_t reading) {
    for (uint8_t i = 1; i < sizeof skin_readings / sizeof *skin_readings; i++) {
        uint16_t above = pgm_read_word(&skin_readings[i - 1]);
        uint16_t below = pgm_read_word(&skin_readings[i]);
        if (reading > above) return BAND_UNKNOWN; /* broken off, or colder than any skin */
        if (reading >= below)
            return (int16_t)(500 * i - 500L * (reading - below) / (above - below));
    }
    return BAND_UNKNOWN; /* shorted, or hotter than it could have become unseen */
}

static void look_at_heat(struct band *band, uint32_t now_us) {
    uint8_t die_is_hot = band->die != BAND_UNKNOWN && band->die > DIE_HOT_CENTI_C;
    uint8_t die_is_cool = band->die == BAND_UNKNOWN || band->die < DIE_COOL_CENTI_C;
    uint8_t skin_is_hot = SKIN_SENSOR && band->skin != BAND_UNKNOWN && band->skin > SKIN_HOT_CENTI_C;
    uint8_t skin_is_cool = !SKIN_SENSOR || (band->skin != BAND_UNKNOWN && band->skin < SKIN_COOL_CENTI_C);
    uint8_t blind = SKIN_SENSOR && band->skin == BAND_UNKNOWN;
    if (blind && !band->blind) {
        silence(band);
        tell(band, SENSOR_LOST, now_us, 0);
    }
    band->blind = blind;
    if (!band->hot && (die_is_hot || skin_is_hot)) {
        band->hot = 1;
        silence(band);
        tell(band, HOT, now_us, skin_is_hot ? band->skin : band->die);
    } else if (band->hot && die_is_cool && skin_is_cool) {
        band->hot = 0;
        tell(band, COOL, now_us, SKIN_SENSOR ? band->skin : band->die);
    }
}

static void look_around(struct band *band, uint32_t now_us) {
    if (band->battery_mv) {
        if (!band->low && band->battery_mv < BATTERY_LOW_MV) {
            band->low = 1;
            tell(band, LOW, now_us, (int16_t)band->battery_mv);
        } else if (band->low && band->battery_mv > BATTERY_GOOD_MV) {
            band->low = 0;
            tell(band, GOOD, now_us, (int16_t)band->battery_mv);
        }
    }
    look_at_heat(band, now_us);
}

/* Send motors whose time is used up to rest, and let them back once a bin's worth is free. */
static void look_at_budget(struct band *band, uint32_t now_us) {
    uint8_t before = band->resting;
    for (uint8_t motor = 0; motor < BAND_MOTORS; motor++) {
        uint8_t bit = (uint8_t)(1 << motor);
        if (band->spent_ms[motor] >= BUDGET_MS) {
            band->resting |= bit;
            band->duty[motor] = band->granted[motor] = 0;
        } else if (band->spent_ms[motor] <= BUDGET_MS - BIN_MS) {
            band->resting &= (uint8_t)~bit;
        }
    }
    if (band->resting & ~before) tell(band, RESTS, now_us, band->resting);
    if (before & ~band->resting) tell(band, RESTED, now_us, band->resting);
}

/* A motor that was off long enough stands still. */
static void note_standstill(struct band *band, uint32_t now_us) {
    for (uint8_t motor = 0; motor < BAND_MOTORS; motor++) {
        uint8_t bit = (uint8_t)(1 << motor);
        if (band->duty[motor])
            band->off_since_us[motor] = now_us;
        else if (now_us - band->off_since_us[motor] >= COAST_MS * 1000UL)
            band->still |= bit;
    }
}

void band_step(struct band *band, uint32_t now_us) {
    account(band, now_us);
    note_standstill(band, now_us);
    look_at_budget(band, now_us);
    if (band->running) {
        if (now_us - band->fed_us > DEAD_MAN_MS * 1000UL) {
            silence(band);
            tell(band, DEAD_MAN, now_us, 0);
        } else if ((int32_t)(now_us - band->until_us) >= 0) {
            uint8_t is_held = !band->is_pattern &&
                              now_us - band->held_since_us >= HOLD_MAX_MS * 1000UL;
            silence(band);
            band->held = is_held;
            tell(band, band->is_pattern ? PATTERN_ENDED : is_held ? HELD_TOO_LONG : EXPIRED, now_us,
                 band->running_seq);
        } else {
            drive(band, now_us);
        }
    }
    look_around(band, now_us);
}
