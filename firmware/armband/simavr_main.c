/* Run the armband's image for the ATmega328P in simavr. */
#include <simavr/avr_adc.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdio.h>
#include <stdlib.h>

#include "lockstep.h"

#define BOOT_START 0x7800 /* as the Makefile links it */
#ifndef MHZ
#define MHZ 8
#endif
#define TCCR0A 0x44
#define OCR0A 0x47
#define OCR0B 0x48
#define TCCR2A 0xB0
#define OCR2A 0xB3
#define OCR2B 0xB4
#define DDRB 0x24
#define DDRD 0x2A

static avr_t *avr;
static avr_irq_t *uart_in;
static int full;
static uint64_t before_cycles; /* simavr begins to count again when the processor is reset */
static avr_cycle_count_t seen_cycle;

static uint64_t cycles(void) {
    if (avr->cycle < seen_cycle) before_cycles += seen_cycle;
    seen_cycle = avr->cycle;
    return before_cycles + avr->cycle;
}

static void on_byte(avr_irq_t *irq, uint32_t value, void *parameter) {
    (void)irq, (void)parameter;
    host_takes((uint8_t)value, cycles() / MHZ);
}

static void on_full(avr_irq_t *irq, uint32_t value, void *parameter) {
    (void)irq, (void)value, (void)parameter;
    full = 1;
}

static void on_room(avr_irq_t *irq, uint32_t value, void *parameter) {
    (void)irq, (void)value, (void)parameter;
    full = 0;
}

static void no_nap(avr_t *processor, avr_cycle_count_t how_long) {
    (void)processor, (void)how_long; /* the caller paces, not simavr */
}

static avr_cycle_count_t stop_here(avr_t *processor, avr_cycle_count_t when, void *parameter) {
    (void)processor, (void)when, (void)parameter;
    return 0;
}

/* What a lab's board has in its boot section; every reset begins there. */
static void add_bootloader(const char *image) {
    elf_firmware_t loader = {0};
    if (elf_read_firmware(image, &loader)) {
        fprintf(stderr, "cannot read the bootloader %s\n", image);
        exit(1);
    }
    avr_loadcode(avr, loader.flash, loader.flashsize, BOOT_START);
    avr->reset_pc = avr->pc = BOOT_START;
}

void machine_start(const char *image, const char *bootloader) {
    elf_firmware_t firmware = {0};
    static const struct surroundings room = ROOM;
    uint32_t flags = 0;
    if (image == NULL || elf_read_firmware(image, &firmware)) {
        fprintf(stderr, "cannot read the image %s\n", image ? image : "(none given)");
        exit(1);
    }
    avr = avr_make_mcu_by_name("atmega328p");
    if (!avr) exit(1);
    avr_init(avr);
    firmware.frequency = MHZ * 1000000;
    avr_load_firmware(avr, &firmware);
    avr->frequency = MHZ * 1000000;
    avr->sleep = no_nap;
    avr->log = LOG_ERROR;
    avr->vcc = avr->avcc = 3300;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    uart_in = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    avr_irq_register_notify(
        avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_byte, NULL);
    avr_irq_register_notify(
        avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF), on_full, NULL);
    avr_irq_register_notify(
        avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON), on_room, NULL);
    machine_surroundings(&room);
    if (bootloader) add_bootloader(bootloader);
}

void machine_run_to(uint64_t t_us) {
    uint64_t target = t_us * MHZ, now = cycles();
    if (now < target) avr_cycle_timer_register(avr, target - now, stop_here, NULL);
    while (cycles() < target) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) {
            fprintf(stderr, "the processor crashed at %04x\n", avr->pc);
            exit(3);
        }
    }
}

int machine_takes(void) { return !full; }

void machine_give(uint8_t byte) { avr_raise_irq(uart_in, byte); }

/* What the pins do: a duty counts only while the timer owns the pin and the pin drives. */
void machine_duties(uint8_t duty[4]) {
    const uint8_t *io = avr->data;
    duty[0] = io[TCCR0A] & 0x80 && io[DDRD] & 1 << 6 ? io[OCR0A] : 0;
    duty[1] = io[TCCR0A] & 0x20 && io[DDRD] & 1 << 5 ? io[OCR0B] : 0;
    duty[2] = io[TCCR2A] & 0x80 && io[DDRB] & 1 << 3 ? io[OCR2A] : 0;
    duty[3] = io[TCCR2A] & 0x20 && io[DDRD] & 1 << 3 ? io[OCR2B] : 0;
}

static void see(int input, uint32_t millivolt) {
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, input), millivolt);
}

void machine_surroundings(const struct surroundings *now) {
    see(ADC_IRQ_ADC0, now->battery_mv / 4);
    see(ADC_IRQ_ADC1, now->motor_mv / 4);
    see(ADC_IRQ_ADC2, (now->skin_reading * 3300 + 1650) / 1023);
    see(ADC_IRQ_TEMP, (uint32_t)(314 + (now->die_centi_c - 2500) / 100));
}

void machine_hang(void) {
    const uint32_t free_word = 0x7000; /* an endless loop in unused flash */
    avr->flash[free_word] = 0xFF;
    avr->flash[free_word + 1] = 0xCF;
    avr->pc = free_word;
    avr->sreg[S_I] = 0;
    avr->state = cpu_Running;
}
