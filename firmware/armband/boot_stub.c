/* A bootloader as boards come with, for tests in simavr alone: it takes the cause of the reset
 * away, waits for a program that nobody sends, and starts the armband's. Two kinds: like Optiboot
 * it hands the cause on and sets the watchdog itself; like the first one (OLD) it knows nothing of
 * the watchdog, which after its own reset bites again every 16 ms.
 */
#include <avr/io.h>
#include <avr/wdt.h>
#include <util/delay_basic.h>

void start(void) __attribute__((naked, used, section(".init0")));
void start(void) {
    __asm__ volatile("clr r1");
    SP = RAMEND;
    uint8_t cause = MCUSR;
#ifndef OLD
    MCUSR = 0;
    wdt_disable(); /* simavr 1.6 takes a new time only so */
    wdt_enable(WDTO_1S);
#endif
    for (uint16_t i = 0; i < 200; i++) _delay_loop_2(2000); /* 4 * 2000 / 8 MHz = 1 ms */
    __asm__ volatile("mov r2, %0\n jmp 0" ::"r"(cause));
}
