#include "hvf_hid.h"

#include <string.h>

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "the reports are little-endian: write the fields byte by byte on this processor"
#endif

typedef char hvf_sizes[sizeof(hvf_input) == 64 && sizeof(hvf_output) == 64 && sizeof(hvf_identity) == 64 &&
                       sizeof(hvf_calibration) == 64 ? 1 : -1];

#define CRC_AT (HVF_REPORT_SIZE - 4)
#define COOLER 500 /* [0.01 degrees C] below the limit, at which a motor counts as cool again */
#define TRIPPED (HVF_STATUS_WATCHDOG | HVF_STATUS_HOT | HVF_STATUS_AMPLIFIER | HVF_STATUS_ENCODER)

const uint8_t hvf_report_descriptor[] = {
    0x06, 0x48, 0xFF,       /* usage page 0xFF48, the vendor's */
    0x09, 0x56,             /* usage 0x56 */
    0xA1, 0x01,             /* collection, application */
    0x15, 0x00,             /*   logical minimum 0 */
    0x26, 0xFF, 0x00,       /*   logical maximum 255 */
    0x75, 0x08, 0x95, 0x3F, /*   63 fields of 8 bits */
    0x85, 0x01, 0x09, 0x01, 0x81, 0x02, /* report 1: input */
    0x85, 0x02, 0x09, 0x02, 0x91, 0x02, /* report 2: output */
    0x85, 0x03, 0x09, 0x03, 0xB1, 0x02, /* report 3: feature, identity */
    0x85, 0x04, 0x09, 0x04, 0xB1, 0x02, /* report 4: feature, calibration */
    0xC0                    /* end of the collection */
};
const size_t hvf_report_descriptor_size = sizeof hvf_report_descriptor;

/* CRC-32/ISO-HDLC, as in Ethernet and zlib: reflected 0x04C11DB7, initial value and final XOR 0xFFFFFFFF. */
uint32_t hvf_crc32(const void *bytes, size_t n) {
    const uint8_t *p = bytes;
    uint32_t crc = 0xFFFFFFFFu;
    while (n--) {
        crc ^= *p++;
        for (int bit = 0; bit < 8; bit++) crc = (crc >> 1) ^ (0xEDB88320u & (0u - (crc & 1u)));
    }
    return ~crc;
}

static void seal(void *report) {
    uint32_t crc = hvf_crc32(report, CRC_AT);
    memcpy((uint8_t *)report + CRC_AT, &crc, 4);
}

static int sound(const uint8_t *bytes, size_t n, uint8_t report) {
    uint32_t crc;
    if (n != HVF_REPORT_SIZE || bytes[0] != report) return 0;
    memcpy(&crc, bytes + CRC_AT, 4);
    return crc == hvf_crc32(bytes, CRC_AT);
}

static void off(hvf_device *device) {
    memset(device->torque, 0, sizeof device->torque);
    device->status &= (uint16_t)~HVF_STATUS_ENABLED;
}

void hvf_begin(hvf_device *device, const hvf_identity *identity, const hvf_calibration *calibration, uint16_t boot) {
    memset(device, 0, sizeof *device);
    device->identity = *identity;
    device->identity.report = HVF_IDENTITY;
    device->identity.major = HVF_VERSION_MAJOR;
    device->identity.minor = HVF_VERSION_MINOR;
    device->identity.magic = HVF_MAGIC;
    device->identity.boot = boot;
    device->calibration = *calibration;
    device->calibration.report = HVF_CALIBRATION;
    device->hot = 10000;
    seal(&device->identity);
    seal(&device->calibration);
}

static int32_t clamped(int32_t torque, uint16_t peak) {
    int32_t limit = 10 * (int32_t)peak;
    return torque > limit ? limit : torque < -limit ? -limit : torque;
}

static int refuse(hvf_device *device) {
    device->refused++;
    device->status |= HVF_STATUS_REFUSED;
    return 0;
}

int hvf_take_output(hvf_device *device, const uint8_t *bytes, size_t n, uint64_t now_us) {
    hvf_output output;
    if (!sound(bytes, n, HVF_OUTPUT)) return refuse(device);
    memcpy(&output, bytes, sizeof output);
    if (output.boot != device->identity.boot) return refuse(device);
    if (device->heard && (int32_t)(output.sequence - device->answered) <= 0) return refuse(device);
    if (output.watchdog_us == 0 || output.watchdog_us > device->identity.watchdog_max_us) return refuse(device);
    device->status &= (uint16_t)~HVF_STATUS_REFUSED;
    device->heard = 1;
    device->answered = output.sequence;
    device->heard_us = now_us;
    device->watchdog_us = output.watchdog_us;
    if (!(output.flags & HVF_ENABLE)) {
        off(device);
        /* A fault that persists trips again in the next tick; a hot motor has to cool first. */
        device->status &= (uint16_t)~(device->warm ? TRIPPED & ~HVF_STATUS_HOT : TRIPPED);
    } else if (!(device->status & TRIPPED)) {
        for (int i = 0; i < 3; i++) device->torque[i] = clamped(output.torque[i], device->identity.peak_torque[i]);
        device->status |= HVF_STATUS_ENABLED;
    }
    return 1;
}

size_t hvf_give_feature(const hvf_device *device, uint8_t report, uint8_t *bytes) {
    if (report == HVF_IDENTITY) memcpy(bytes, &device->identity, HVF_REPORT_SIZE);
    else if (report == HVF_CALIBRATION) memcpy(bytes, &device->calibration, HVF_REPORT_SIZE);
    else return 0;
    return HVF_REPORT_SIZE;
}

int hvf_take_feature(hvf_device *device, const uint8_t *bytes, size_t n) {
    if (!sound(bytes, n, HVF_CALIBRATION) || (device->status & HVF_STATUS_ENABLED)) return 0;
    memcpy(&device->calibration, bytes, HVF_REPORT_SIZE);
    return 1;
}

static uint16_t trips(hvf_device *device, const hvf_sensors *sensors) {
    uint16_t status = 0;
    device->warm = 0;
    if ((device->status & HVF_STATUS_ENABLED) && sensors->time_us > device->heard_us + device->watchdog_us)
        status |= HVF_STATUS_WATCHDOG;
    for (int i = 0; i < 3; i++) {
        if (sensors->temperature[i] == HVF_NO_TEMPERATURE) continue;
        if (sensors->temperature[i] >= device->hot) status |= HVF_STATUS_HOT;
        if (sensors->temperature[i] >= device->hot - COOLER) device->warm = 1;
    }
    if (sensors->amplifier_fault) status |= HVF_STATUS_AMPLIFIER;
    if (sensors->encoder_fault) status |= HVF_STATUS_ENCODER;
    return status;
}

void hvf_drive(const hvf_device *device, hvf_motors *motors) {
    motors->on = (device->status & HVF_STATUS_ENABLED) != 0;
    memcpy(motors->torque, device->torque, sizeof motors->torque);
}

void hvf_tick(hvf_device *device, const hvf_sensors *sensors, hvf_input *report) {
    device->status |= trips(device, sensors);
    if (device->status & TRIPPED) off(device);

    memset(report, 0, sizeof *report);
    report->report = HVF_INPUT;
    report->flags = sensors->pressed ? HVF_SWITCH : 0;
    report->status = device->status | (device->calibration.flags & HVF_CALIBRATED ? HVF_STATUS_CALIBRATED : 0);
    report->sequence = ++device->sequence;
    report->time_us = sensors->time_us;
    memcpy(report->encoder, sensors->encoder, sizeof report->encoder);
    memcpy(report->temperature, sensors->temperature, sizeof report->temperature);
    report->boot = device->identity.boot;
    report->answered = device->answered;
    report->held_us = device->heard ? (uint32_t)(sensors->time_us - device->heard_us) : 0;
    report->refused = device->refused;
    seal(report);
}
