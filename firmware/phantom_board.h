/* What a board has to offer `phantom_main.c`: eight functions. None of them waits. */
#ifndef PHANTOM_BOARD_H
#define PHANTOM_BOARD_H

#include "hvf_hid.h"

void board_begin(hvf_identity *identity, hvf_calibration *calibration, uint16_t *boot);
int board_period(void);                         /* 1 once a period, at its beginning, else 0; -1 to end (never, on a board) */
uint64_t board_time_us(void);                   /* since power-up; a timer of 32 bits has to be extended: it wraps after 71 minutes */
void board_sense(hvf_sensors *sensors);         /* encoders latched at once, temperatures, switch, faults, time */
void board_drive(const hvf_motors *motors);     /* current = torque / k_t; the amplifiers' enable line follows `on` */
size_t board_receive(uint8_t *bytes, size_t n); /* an output or feature report if one has come, else 0 */
void board_send(const hvf_input *report);       /* into the endpoint's buffer, over what was not fetched */
void board_feed_hardware_watchdog(void);        /* a processor that hangs is reset, and its amplifiers go off */

#endif
