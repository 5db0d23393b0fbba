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
/* The processor's own temperature, good to about 10 degrees: it guards the electronics. */
#ifndef DIE_HOT_CENTI_C
#define DIE_HOT_CENTI_C 6000
#endif
#ifndef DIE_COOL_CENTI_C
#define DIE_COOL_CENTI_C 5500
#endif

/* A thermistor between motors and skin; with it, nothing runs unless it can be read. 43 degrees is
 * what IEC 60601-1 allows of a part that touches skin for ten minutes and longer. */
#ifndef SKIN_SENSOR
#define SKIN_SENSOR 0
#endif
#ifndef SKIN_HOT_CENTI_C
#define SKIN_HOT_CENTI_C 4300
#endif
#ifndef SKIN_COOL_CENTI_C
#define SKIN_COOL_CENTI_C 4100
#endif

/* The highest mean voltage the motors' maker allows, and the supply that is assumed until it has
 * been measured: a full cell that reaches the motors past a broken regulator. */
#ifndef MOTOR_MAX_MV
#define MOTOR_MAX_MV 3600
#endif
#ifndef MOTOR_WORST_MV
#define MOTOR_WORST_MV 4250
#endif

/* Current of one motor at full duty, while it starts and later, and what the supply gives to all. */
#ifndef MOTOR_START_MA
#define MOTOR_START_MA 120
#endif
#ifndef MOTOR_RUN_MA
#define MOTOR_RUN_MA 80
#endif
#ifndef CURRENT_MAX_MA
#define CURRENT_MAX_MA 500
#endif
#ifndef START_MS
#define START_MS 50
#endif
#ifndef STAGGER_MS
#define STAGGER_MS 4
#endif
#ifndef COAST_MS
#define COAST_MS 100 /* a motor that was on so lately still turns, and needs no start */
#endif

/* How long one motor may be on in any window, and one setting may hold however often it comes. */
#ifndef WINDOW_MS
#define WINDOW_MS 120000
#endif
#ifndef BUDGET_MS
#define BUDGET_MS 60000
#endif
#ifndef HOLD_MAX_MS
#define HOLD_MAX_MS 20000
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
#if WINDOW_MS < 2400 || WINDOW_MS > 1200000 || BUDGET_MS < WINDOW_MS / 12 || BUDGET_MS > WINDOW_MS
#error "WINDOW_MS is 2400 to 1200000, BUDGET_MS a twelfth of it to all of it"
#endif
#if HOLD_MAX_MS < TTL_MAX_MS || HOLD_MAX_MS > 600000
#error "HOLD_MAX_MS is TTL_MAX_MS to 600000"
#endif
#if START_MS < STAGGER_MS || START_MS > 1000 || COAST_MS > 1000
#error "START_MS is STAGGER_MS to 1000, COAST_MS at most 1000"
#endif
#if CURRENT_MAX_MA < 1 || CURRENT_MAX_MA > 5000 || MOTOR_RUN_MA < 1 || MOTOR_START_MA < MOTOR_RUN_MA
#error "currents are positive, CURRENT_MAX_MA at most 5000, MOTOR_START_MA at least MOTOR_RUN_MA"
#endif

#endif
