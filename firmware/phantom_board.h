/* What a board has to provide for `phantom_main.c`: eight functions. None of them blocks. */
#ifndef PHANTOM_BOARD_H
#define PHANTOM_BOARD_H

#include "hvf_hid.h"

void board_begin(hvf_identity *identity, hvf_calibration *calibration, uint16_t *boot);
int board_period(void);                         /* 1 once at the beginning of a period, else 0; -1 to end (never on a board) */
uint64_t board_time_us(void);                   /* since power-up; a 32-bit timer has to be extended, since it wraps after 71 minutes */
void board_sense(hvf_sensors *sensors);         /* encoders latched at once, temperatures, switch, faults, time */
void board_drive(const hvf_motors *motors);     /* current = torque / k_t; the amplifiers' enable line follows `on` */
size_t board_receive(uint8_t *bytes, size_t n); /* an output or feature report if one has arrived, else 0 */
void board_send(const hvf_input *report);       /* into the endpoint's buffer, over a report not yet fetched */
void board_feed_hardware_watchdog(void);        /* it resets a processor that hangs, and the amplifiers go off */

#endif
