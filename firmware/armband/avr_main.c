/* The armband on an ATmega328P at 8 MHz, 3.3 V: UART, four PWM motors, clock, ADC, watchdog.
 *
 * Motors 1..4: PD6 (OC0A), PD5 (OC0B), PB3 (OC2A), PD3 (OC2B), each the gate of a MOSFET with a
 * pull-down resistor, so that a processor in reset leaves them off. Battery: ADC0, the motors'
 * supply: ADC1, each through a divider by four (300k, 100k) against the 1.1 V reference. Skin: a
 * thermistor at ADC2 against 10k to the processor's supply. The die's own sensor is good to about
 * 10 degrees.
 */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/delay.h>

#include "band.h"
#include "config.h"

#define UBRR_DOUBLE ((F_CPU + 4UL * BAUD) / (8UL * BAUD) - 1)
#define TICK_US 1000
#define TICKS_PER_CONVERSION 10
#define REFERENCE_SETTLES_MS 5
#define RX_BYTES 64 /* a power of two */

static volatile uint8_t rx[RX_BYTES], rx_head, rx_tail;
static volatile uint16_t turns; /* of the 65.536 ms clock */
static volatile uint8_t ticks;
#define KEPT __attribute__((section(".noinit"))) /* a reset leaves it as it is */

static struct band band;
static struct band_ledger ledger KEPT;
static uint8_t reset_cause KEPT;
static uint8_t told_by_bootloader KEPT;

/* Before main: the watchdog may still run, at 16 ms, from the reset that it caused. Optiboot has
 * cleared the register of causes and leaves what stood there in r2. */
void keep_cause(void) __attribute__((naked, used, section(".init3")));
void keep_cause(void) {
    __asm__ volatile("sts %0, r2" ::"i"(&told_by_bootloader));
    reset_cause = MCUSR;
    MCUSR = 0;
    wdt_disable(); /* simavr 1.6 takes a new time only so; the fuse WDTON makes it void */
    wdt_enable(WDTO_120MS);
    if (!reset_cause) reset_cause = told_by_bootloader;
}

ISR(USART_RX_vect) {
    uint8_t byte = UDR0, head = (rx_head + 1) & (RX_BYTES - 1);
    if (head != rx_tail) { /* a full buffer drops the byte, and the frame fails its check */
        rx[rx_head] = byte;
        rx_head = head;
    }
}

ISR(TIMER1_OVF_vect) { turns++; }

ISR(TIMER1_COMPA_vect) {
    OCR1A += TICK_US;
    ticks++;
}

static uint32_t now_us(void) {
    uint8_t state = SREG;
    cli();
    uint16_t low = TCNT1, high = turns;
    if (TIFR1 & _BV(TOV1) && low < 0x8000) high++;
    SREG = state;
    return (uint32_t)high << 16 | low;
}

/* What the inputs are measured against, and which; the first conversion after a switch is void. */
#define INNER_REFERENCE (_BV(REFS1) | _BV(REFS0))
#define SUPPLY_REFERENCE _BV(REFS0)
static const uint8_t inputs[] = {INNER_REFERENCE | 0, INNER_REFERENCE | 1, INNER_REFERENCE | 8,
                                 SUPPLY_REFERENCE | 2};
enum { BATTERY, MOTORS, DIE, SKIN, INPUTS = SKIN_SENSOR ? SKIN + 1 : DIE + 1 };

static void set_up(void) {
    PORTD &= (uint8_t)~(_BV(PD6) | _BV(PD5) | _BV(PD3));
    PORTB &= (uint8_t)~_BV(PB3);
    DDRD |= _BV(PD6) | _BV(PD5) | _BV(PD3);
    DDRB |= _BV(PB3);
    TCCR0A = _BV(WGM01) | _BV(WGM00);
    TCCR2A = _BV(WGM21) | _BV(WGM20);
    TCCR0B = _BV(CS01); /* 8 MHz / 8 / 256 = 3.9 kHz */
    TCCR2B = _BV(CS21);

    TCCR1B = _BV(CS11); /* counts microseconds */
    OCR1A = TICK_US;
    TIMSK1 = _BV(TOIE1) | _BV(OCIE1A);

    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UBRR0 = UBRR_DOUBLE;
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);

    ADMUX = inputs[0];
    ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1); /* 125 kHz */
}

/* A compare output of 0 still gives a spike, so an idle motor's pin is taken from the timer. */
static void apply(void) {
    uint8_t a = _BV(WGM01) | _BV(WGM00), b = _BV(WGM21) | _BV(WGM20);
    OCR0A = band.duty[0];
    OCR0B = band.duty[1];
    OCR2A = band.duty[2];
    OCR2B = band.duty[3];
    if (band.duty[0]) a |= _BV(COM0A1);
    if (band.duty[1]) a |= _BV(COM0B1);
    if (band.duty[2]) b |= _BV(COM2A1);
    if (band.duty[3]) b |= _BV(COM2B1);
    TCCR0A = a;
    TCCR2A = b;
}

static void take(uint8_t input, uint16_t value) {
    switch (input) {
    case BATTERY:
        band.battery_mv = (uint16_t)((uint32_t)value * 4400 / 1024);
        break;
    case MOTORS:
        band.motor_mv = (uint16_t)((uint32_t)value * 4400 / 1024);
        break;
    case DIE:
        band.die = (int16_t)(2500 + ((int32_t)value * 1074 - 314000L) / 10);
        break;
    case SKIN:
        band.skin = band_skin_of(value);
        break;
    }
}

/* Know everything before the first command; the reference needs some ms to settle. */
static void measure_all(void) {
    _delay_ms(REFERENCE_SETTLES_MS);
    for (uint8_t input = INPUTS; input--;) { /* battery last: `measure` goes on with it */
        ADMUX = inputs[input];
        for (uint8_t conversions = 0; conversions < 2; conversions++) {
            ADCSRA |= _BV(ADSC);
            while (ADCSRA & _BV(ADSC)) continue;
        }
        take(input, ADC);
    }
}

/* Go on with one input after the other, two conversions each. */
static void measure(void) {
    static uint8_t input, conversions;
    if (ADCSRA & _BV(ADSC)) return;
    if (++conversions == 3) {
        take(input, ADC);
        input = (uint8_t)((input + 1) % INPUTS);
        ADMUX = inputs[input];
        conversions = 1;
    }
    ADCSRA |= _BV(ADSC);
}

int main(void) {
    uint8_t seen = 0, until_conversion = 0, byte;
    set_up();
    band_boot(&band, &ledger, 0, reset_cause);
    measure_all();
    set_sleep_mode(SLEEP_MODE_IDLE);
    sei();
    for (;;) {
        while (rx_head != rx_tail) {
            byte = rx[rx_tail];
            rx_tail = (rx_tail + 1) & (RX_BYTES - 1);
            band_receive(&band, byte, now_us());
        }
        if (ticks != seen) { /* a clock that stands still starves the watchdog, as it should */
            seen = ticks;
            wdt_reset();
            band_step(&band, now_us());
            if (!until_conversion--) {
                until_conversion = TICKS_PER_CONVERSION;
                measure();
            }
        }
        apply();
        while (UCSR0A & _BV(UDRE0) && band_next(&band, &byte)) UDR0 = byte;
        if (band.tx_head == band.tx_tail) {
            cli();
            if (rx_head == rx_tail && ticks == seen) {
                sleep_enable();
                sei();
                sleep_cpu();
                sleep_disable();
            }
            sei();
        }
    }
}
