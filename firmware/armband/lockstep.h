/* Let another program drive a simulated armband: in lockstep by lines of text, or on a
 * pseudo-terminal in real time. A machine is the AVR image in simavr, or the behaviour compiled
 * for this computer.
 */
#ifndef ARMBAND_LOCKSTEP_H
#define ARMBAND_LOCKSTEP_H

#include <stdint.h>

/* What the analogue inputs see; the thermistor's divider of 1023 steps. */
struct surroundings {
    unsigned battery_mv, motor_mv;
    int die_centi_c;
    unsigned skin_reading;
};
#define ROOM {3900, 3300, 2500, 512}

/* What a machine offers. `bootloader` is run at every reset, before the image (NULL: none). */
void machine_start(const char *image, const char *bootloader);
void machine_run_to(uint64_t t_us);
int machine_takes(void); /* may one more byte be given now? */
void machine_give(uint8_t byte);
void machine_duties(uint8_t duty[4]);
void machine_surroundings(const struct surroundings *now);
void machine_hang(void); /* the program runs wild: an endless loop without interrupts */

/* What a machine calls for every byte that it sends. */
void host_takes(uint8_t byte, uint64_t t_us);

#endif
