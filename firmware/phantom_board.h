/* What a board has to offer `phantom_main.c`: seven functions. */
#ifndef PHANTOM_BOARD_H
#define PHANTOM_BOARD_H

#include "hvf_hid.h"

void board_begin(hvf_identity *identity, hvf_calibration *calibration, uint16_t *boot);
int board_waits_for_tick(void);                 /* returns at the next period's beginning; 0 to end (never, on a board) */
void board_sense(hvf_sensors *sensors);         /* encoders latched at once, temperatures, switch, faults, time */
void board_drive(const hvf_motors *motors);     /* current = torque / k_t; the amplifiers' enable line follows `on` */
size_t board_receive(uint8_t *bytes, size_t n); /* an output or feature report if one has come, else 0; never waits */
void board_send(const hvf_input *report);       /* into the endpoint's buffer, over what was not fetched; never waits */
void board_feed_hardware_watchdog(void);        /* a processor that hangs is reset, and its amplifiers go off */

#endif
