/* The 64-byte reports of a Phantom that speaks USB HID, and the state machine of its firmware: docs/reference/hid-protocol.md.
 *
 * Plain C99, no allocation, no hardware. Integers are little-endian, as on every Cortex-M and x86; hvf_hid.c refuses
 * to compile elsewhere. Every field lies at a multiple of its size, so no packing is needed.
 */
#ifndef HVF_HID_H
#define HVF_HID_H

#include <stddef.h>
#include <stdint.h>

#define HVF_REPORT_SIZE 64
#define HVF_VERSION_MAJOR 1 /* a reader of another major version sends no torque */
#define HVF_VERSION_MINOR 0
#define HVF_MAGIC 0x31465648u /* "HVF1" */

enum { HVF_INPUT = 1, HVF_OUTPUT = 2, HVF_IDENTITY = 3, HVF_CALIBRATION = 4 }; /* report numbers, byte 0 */
enum { HVF_SWITCH = 1 };                                                       /* hvf_input.flags */
enum { HVF_ENABLE = 1 };                                                       /* hvf_output.flags */
enum { HVF_CALIBRATED = 1 };                                                   /* hvf_calibration.flags */
enum {                                                                         /* hvf_input.status */
    HVF_STATUS_ENABLED = 1,     /* the motors are on */
    HVF_STATUS_CALIBRATED = 2,  /* the zeros of the encoders are known */
    HVF_STATUS_WATCHDOG = 4,    /* no command in time; off until one without enable arrives */
    HVF_STATUS_HOT = 8,         /* a motor is too hot; off until 5 degrees below the limit and one without enable arrives */
    HVF_STATUS_AMPLIFIER = 16,  /* an amplifier reports a fault */
    HVF_STATUS_ENCODER = 32,    /* an encoder lost counts */
    HVF_STATUS_REFUSED = 64     /* the last output report was not accepted */
};
enum { HVF_HAS_MOTORS = 1, HVF_HAS_WATCHDOG = 2, HVF_HAS_TEMPERATURE = 4, HVF_HAS_GIMBAL = 8 }; /* capabilities */

#define HVF_NO_TEMPERATURE INT16_MIN

typedef struct { /* device to host, once a period */
    uint8_t report, flags;
    uint16_t status;
    uint32_t sequence;      /* incremented in every report */
    uint64_t time_us;       /* when the encoders were read, since power-up */
    int32_t encoder[6];     /* counts: motors 1..3, gimbal 1..3 */
    int16_t temperature[3]; /* of the motors, 0.01 degrees C */
    uint16_t boot;          /* differs after every reset */
    uint32_t answered;      /* sequence number of the last output report accepted */
    uint32_t held_us;       /* time from its arrival to time_us */
    uint16_t refused;       /* output reports not accepted since power-up */
    uint16_t reserved;
    uint32_t crc;
} hvf_input;

typedef struct { /* host to device */
    uint8_t report, flags;
    uint16_t boot;        /* of the input report answered: a command from before a reset is refused */
    uint32_t sequence;    /* larger than that of the last output report */
    uint32_t watchdog_us; /* motors off if the next takes longer */
    int32_t torque[3];    /* at the motors' shafts, 1e-6 N m */
    uint32_t answers;     /* sequence number of the input report answered */
    uint8_t reserved[32];
    uint32_t crc;
} hvf_output;

typedef struct { /* feature report, read only */
    uint8_t report, major, minor, reserved;
    uint32_t magic, capabilities;
    uint16_t rate_hz, boot;
    uint32_t watchdog_max_us;
    uint16_t peak_torque[3]; /* at the motors' shafts, 1e-5 N m */
    char name[12], firmware[8], serial[14]; /* UTF-8, padded with zeros */
    uint32_t crc;
} hvf_identity;

typedef struct { /* feature report, read and, while the motors are off, written */
    uint8_t report, flags;
    uint16_t reserved;
    int32_t zero[6];            /* counts at which the joint is at 0 */
    int32_t counts_per_turn[6]; /* per turn of the joint, 1e-3 counts; negative where the encoder counts backwards */
    uint16_t motor_turns[3];    /* per turn of the joint, 1e-3 */
    uint16_t reserved2;
    uint32_t crc;
} hvf_calibration;

typedef struct { /* read from the board */
    uint64_t time_us;
    int32_t encoder[6];
    int16_t temperature[3];
    uint8_t pressed, amplifier_fault, encoder_fault;
} hvf_sensors;

typedef struct { /* commanded to the board */
    uint8_t on;
    int32_t torque[3]; /* at the shafts, 1e-6 N m */
} hvf_motors;

typedef struct {
    hvf_identity identity;
    hvf_calibration calibration;
    int16_t hot; /* motors off above, 0.01 degrees C */
    uint32_t sequence, answered;
    uint64_t heard_us;
    uint32_t watchdog_us;
    uint16_t status, refused;
    uint8_t heard; /* an output report was accepted since power-up */
    uint8_t warm;  /* a motor is above the limit or less than 5 degrees below it */
    int32_t torque[3];
} hvf_device;

uint32_t hvf_crc32(const void *bytes, size_t n);

/* Power-up: motors off; `boot` is a number that differs from that of the last power-up. */
void hvf_begin(hvf_device *device, const hvf_identity *identity, const hvf_calibration *calibration, uint16_t boot);

/* An output report arrived; returns 1 if it is accepted. */
int hvf_take_output(hvf_device *device, const uint8_t *bytes, size_t n, uint64_t now_us);

/* A feature report is requested: writes 64 bytes and returns 64, or 0 if there is no such report. */
size_t hvf_give_feature(const hvf_device *device, uint8_t report, uint8_t *bytes);

/* A feature report arrived; returns 1 if it is accepted: only a calibration, and only while the motors are off. */
int hvf_take_feature(hvf_device *device, const uint8_t *bytes, size_t n);

/* Once a period: checks for faults, and fills the input report. */
void hvf_tick(hvf_device *device, const hvf_sensors *sensors, hvf_input *report);

/* The commands to the motors, after each of the above. */
void hvf_drive(const hvf_device *device, hvf_motors *motors);

/* The report descriptor, for the USB stack: vendor page 0xFF48, usage 0x56, four reports of 63 bytes and a number. */
extern const uint8_t hvf_report_descriptor[];
extern const size_t hvf_report_descriptor_size;

#endif
