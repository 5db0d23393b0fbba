/* The board of `visavis sync-test` on an ATmega328P at 16 MHz (Arduino Uno, Nano): photodiode at
 * A0, microphone at A1, accelerometer or piezo disc at A2, each 0 to 5 V, 4000 samples a second.
 *
 * Frames are the armband's: COBS(type, sequence number, payload, CRC-16) and a zero.
 * devices/sync/board_codec.py has the table. Sound and motion are told as they are read; for their
 * size apart from their phase, rectify them before (docs/synchronisation.md has the circuits).
 */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/crc16.h>

#define BAUD 250000UL
#define PERIOD_US 250
#define BLOCK 12
#define CHANNELS 3
#define HEAD 8 /* type, sequence number, time, spacing */
#define TX_BYTES 128
#define RX_BYTES 16
enum { SAMPLES = 0x41, ASK = 0x42, TOLD = 0x43 };

static volatile uint32_t turns; /* of the timer, 32.768 ms each */
static volatile uint32_t due_us;
static volatile uint8_t is_due, was_late;
static volatile uint8_t rx[RX_BYTES], rx_head, rx_tail;
static uint8_t tx[TX_BYTES], tx_head, tx_tail;
static uint8_t ask[RX_BYTES], ask_size;

ISR(TIMER1_OVF_vect) { turns++; }

static uint32_t now_us(void) {
    uint8_t state = SREG;
    cli();
    uint16_t low = TCNT1;
    uint32_t high = turns;
    if (TIFR1 & _BV(TOV1) && low < 0x8000) high++;
    SREG = state;
    return high << 15 | low >> 1;
}

ISR(TIMER1_COMPA_vect) {
    OCR1A += 2 * PERIOD_US;
    due_us += PERIOD_US;
    was_late |= is_due; /* the sample before was not taken */
    is_due = 1;
}

ISR(USART_RX_vect) {
    uint8_t byte = UDR0, head = (rx_head + 1) % RX_BYTES;
    if (head == rx_tail) return;
    rx[rx_head] = byte;
    rx_head = head;
}

static void send_some(void) {
    if (tx_head == tx_tail || !(UCSR0A & _BV(UDRE0))) return;
    UDR0 = tx[tx_tail];
    tx_tail = (tx_tail + 1) % TX_BYTES;
}

/* Queue a whole frame or nothing; `raw` has room for both checks, `check` is the payload's own. */
static void tell(uint8_t *raw, uint8_t size, uint16_t check) {
    uint16_t crc = 0xFFFF;
    raw[size++] = (uint8_t)check;
    raw[size++] = (uint8_t)(check >> 8);
    for (uint8_t i = 0; i < size; i++) crc = _crc_xmodem_update(crc, raw[i]);
    raw[size++] = (uint8_t)crc;
    raw[size++] = (uint8_t)(crc >> 8);
    uint8_t free_bytes = (uint8_t)((tx_tail - tx_head - 1) & (TX_BYTES - 1));
    if (free_bytes < size + 2) return;
    uint8_t mark = tx_head, run = 1;
    tx_head = (tx_head + 1) % TX_BYTES;
    for (uint8_t i = 0; i < size; i++) {
        if (raw[i]) {
            tx[tx_head] = raw[i];
            run++;
        } else {
            tx[mark] = run;
            mark = tx_head;
            run = 1;
        }
        tx_head = (tx_head + 1) % TX_BYTES;
    }
    tx[mark] = run;
    tx[tx_head] = 0;
    tx_head = (tx_head + 1) % TX_BYTES;
}

static void put_time(uint8_t *at, uint32_t us) {
    for (uint8_t i = 0; i < 4; i++, us >>= 8) at[i] = (uint8_t)us;
}

/* The payload's own check goes on with every sample: there is no time for all of it at once. */
static uint16_t checked(uint16_t check, const uint8_t *from, uint8_t size) {
    while (size--) check = _crc16_update(check, *from++);
    return check;
}

static void answer(uint8_t seq) {
    uint8_t raw[10] = {TOLD, seq};
    put_time(raw + 2, now_us());
    tell(raw, 6, checked(0, raw + 2, 4));
}

/* Take a question: five stuffed bytes of type, number and CRC. */
static void listen(void) {
    while (rx_head != rx_tail) {
        uint8_t byte = rx[rx_tail];
        rx_tail = (rx_tail + 1) % RX_BYTES;
        if (byte) {
            if (ask_size < RX_BYTES) ask[ask_size++] = byte;
            continue;
        }
        uint8_t raw[RX_BYTES], size = 0, from = 0, is_whole = ask_size == 5;
        while (is_whole && from < ask_size) {
            uint8_t skip = ask[from];
            if (!skip || skip > ask_size - from) is_whole = 0;
            for (uint8_t i = 1; is_whole && i < skip; i++) raw[size++] = ask[from + i];
            from = (uint8_t)(from + skip);
            if (is_whole && from < ask_size) raw[size++] = 0;
        }
        ask_size = 0;
        if (!is_whole || size != 4 || raw[0] != ASK) continue;
        uint16_t crc = _crc_xmodem_update(_crc_xmodem_update(0xFFFF, raw[0]), raw[1]);
        if (raw[2] == (uint8_t)crc && raw[3] == (uint8_t)(crc >> 8)) answer(raw[1]);
    }
}

int main(void) {
    TCCR1B = _BV(CS11); /* 2 MHz */
    OCR1A = 2 * PERIOD_US;
    TIMSK1 = _BV(TOIE1) | _BV(OCIE1A);
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UBRR0 = F_CPU / (8 * BAUD) - 1;
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
    ADMUX = _BV(REFS0) | _BV(ADLAR);
    ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS0); /* 500 kHz: 26 us a conversion, 8 bits good */
    sei();
    uint8_t raw[HEAD + BLOCK * CHANNELS + 4] = {SAMPLES}, at = 0, seq = 0;
    uint16_t check = 0;
    for (;;) {
        listen();
        send_some();
        if (!is_due) continue;
        uint8_t state = SREG;
        cli();
        uint32_t sample_us = due_us;
        is_due = 0;
        SREG = state;
        if (at == 0) {
            put_time(raw + 2, sample_us);
            raw[6] = (uint8_t)PERIOD_US;
            raw[7] = PERIOD_US >> 8;
            check = checked(0, raw + 2, HEAD - 2);
        }
        for (uint8_t channel = 0; channel < CHANNELS; channel++) {
            ADMUX = (uint8_t)(_BV(REFS0) | _BV(ADLAR) | channel);
            ADCSRA |= _BV(ADSC);
            while (ADCSRA & _BV(ADSC)) send_some();
            raw[HEAD + CHANNELS * at + channel] = ADCH;
        }
        check = checked(check, raw + HEAD + CHANNELS * at, CHANNELS);
        if (++at < BLOCK) continue;
        at = 0;
        raw[1] = seq++;
        if (!was_late) tell(raw, HEAD + BLOCK * CHANNELS, check); /* the host counts what is lost */
        was_late = 0;
    }
}
