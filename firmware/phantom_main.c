/* The reference firmware: one loop, which sends reports at the rate given by the identity. Feature reads are answered by the USB
 * stack's interrupt with `hvf_give_feature(&phantom, …)`, which only reads. */
#include "phantom_board.h"

hvf_device phantom;

int main(void) {
    hvf_identity identity = {0};
    hvf_calibration calibration = {0};
    hvf_sensors sensors = {0};
    hvf_motors motors = {0};
    hvf_input report;
    uint8_t bytes[HVF_REPORT_SIZE];
    uint16_t boot = 0;
    size_t n;

    board_begin(&identity, &calibration, &boot);
    hvf_begin(&phantom, &identity, &calibration, boot);
    for (int period = 0; period >= 0; period = board_period()) {
        while ((n = board_receive(bytes, sizeof bytes)) > 0) {
            if (bytes[0] != HVF_OUTPUT) hvf_take_feature(&phantom, bytes, n);
            else if (hvf_take_output(&phantom, bytes, n, board_time_us())) {
                hvf_drive(&phantom, &motors); /* at once: waiting for the next period would delay the force */
                board_drive(&motors);
            }
        }
        if (!period) continue;
        board_sense(&sensors);
        hvf_tick(&phantom, &sensors, &report);
        hvf_drive(&phantom, &motors);
        board_drive(&motors);
        board_send(&report);
        board_feed_hardware_watchdog();
    }
    return 0;
}
