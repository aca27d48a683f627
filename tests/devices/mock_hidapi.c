/* hidapi's functions (hidapi.h) with the reference firmware behind them: a report is there once after each tick. */
#include <string.h>

#include "../../firmware/hvf_hid.h"

static hvf_device device;
static hvf_sensors sensors;
static hvf_input report;
static int due;

void mock_begin(const hvf_identity *identity, const hvf_calibration *calibration) {
    hvf_begin(&device, identity, calibration, 1);
}
void mock_tick(const int32_t *encoder) {
    memcpy(sensors.encoder, encoder, sizeof sensors.encoder);
    sensors.time_us += 1000;
    for (int i = 0; i < 3; i++) sensors.temperature[i] = HVF_NO_TEMPERATURE;
    hvf_tick(&device, &sensors, &report);
    due = 1;
}

int hid_init(void) { return 0; }
void *hid_open_path(const char *path) { return path[0] ? &device : NULL; }
int hid_set_nonblocking(void *d, int on) { (void)d, (void)on; return 0; }
void hid_close(void *d) { (void)d; }
int hid_get_feature_report(void *d, unsigned char *bytes, size_t n) {
    return n < 64 ? -1 : (int)hvf_give_feature(d, bytes[0], bytes);
}
int hid_send_feature_report(void *d, const unsigned char *bytes, size_t n) {
    return hvf_take_feature(d, bytes, n) ? (int)n : -1;
}
int hid_read_timeout(void *d, unsigned char *bytes, size_t n, int milliseconds) {
    (void)d, (void)milliseconds;
    if (!due || n < sizeof report) return 0;
    memcpy(bytes, &report, sizeof report);
    due = 0;
    return sizeof report;
}
int hid_write(void *d, const unsigned char *bytes, size_t n) {
    return hvf_take_output(d, bytes, n, sensors.time_us) ? (int)n : -1;
}
