/* What a laboratory may change; each value can also be given on the command line of make. */
#ifndef ARMBAND_CONFIG_H
#define ARMBAND_CONFIG_H

#ifndef BAUD
#define BAUD 38400 /* 8 MHz gives this within 0.2 %; 57600 would be 2.1 % off */
#endif

/* The drive's range: PWM duty at the slowest and fastest vibration that was pilot-tested. */
#ifndef DUTY_MIN
#define DUTY_MIN 115
#endif
#ifndef DUTY_MAX
#define DUTY_MAX 255
#endif
#ifndef RATE_MIN_HZ
#define RATE_MIN_HZ 57
#endif
#ifndef RATE_MAX_HZ
#define RATE_MAX_HZ 126
#endif

#ifndef DEAD_MAN_MS
#define DEAD_MAN_MS 250
#endif
#ifndef TTL_MAX_MS
#define TTL_MAX_MS 10000
#endif
#ifndef PATTERN_MAX_MS
#define PATTERN_MAX_MS 2000
#endif

#ifndef BATTERY_LOW_MV
#define BATTERY_LOW_MV 3500
#endif
#ifndef BATTERY_GOOD_MV
#define BATTERY_GOOD_MV 3600
#endif
#ifndef BATTERY_EMPTY_MV
#define BATTERY_EMPTY_MV 3300
#endif
#ifndef HOT_CENTI_C
#define HOT_CENTI_C 6000
#endif
#ifndef COOL_CENTI_C
#define COOL_CENTI_C 5500
#endif

#ifndef SERIAL_NUMBER
#define SERIAL_NUMBER "VA000001"
#endif

#if DUTY_MIN < 1 || DUTY_MAX > 255 || DUTY_MIN >= DUTY_MAX
#error "DUTY_MIN and DUTY_MAX must be 1..255 and rise"
#endif
#if RATE_MIN_HZ < 1 || RATE_MAX_HZ > 255 || RATE_MIN_HZ >= RATE_MAX_HZ
#error "RATE_MIN_HZ and RATE_MAX_HZ must be 1..255 and rise"
#endif
#if DEAD_MAN_MS > 300
#error "motors must stop at most 300 ms after the host is gone"
#endif

#endif
