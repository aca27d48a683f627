/* OpenHaptics' HDAPI as far as it is used, with a device whose pose and faults the test sets.
 * Its scheduler is a thread at the rate that was set, or, after mock_manual(1), whoever calls mock_tick(). */
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <string.h>
#include <time.h>

typedef struct { unsigned errorCode; int internalErrorCode; unsigned hHD; } HDErrorInfo;
typedef unsigned (*Callback)(void *);

static struct {
    double position[3], transform[16], velocity[3], gimbal[3], temperature, force[3], largest;
    int buttons, enabled, begun, opened, manual, running, missing, style, no_scheduler;
    unsigned calibration, errors[32];
    int first, last;
    unsigned long rate, frames, served;
    Callback callback;
    void *data;
    unsigned short priority;
    pthread_t thread;
} m;

extern void heap_open(void) __attribute__((weak)); /* if heap calls are counted, those of its thread are counted too */

static void fail(unsigned code) { if (m.last - m.first < 32) m.errors[m.last++ % 32] = code; }

/* What the test does. */
void mock_reset(void) {
    memset(&m, 0, sizeof m);
    m.calibration = 0x5000; m.style = 2; m.largest = 8.5; m.manual = 1;
    for (int i = 0; i < 4; i++) m.transform[5 * i] = 1.0;
}
void mock_manual(int manual) { m.manual = manual; }
void mock_pose(const double *transform) { memcpy(m.transform, transform, sizeof m.transform); memcpy(m.position, transform + 12, sizeof m.position); }
void mock_velocity(double x, double y, double z) { m.velocity[0] = x; m.velocity[1] = y; m.velocity[2] = z; }
void mock_buttons(int buttons) { m.buttons = buttons; }
void mock_calibration(unsigned state) { m.calibration = state; }
void mock_error(unsigned code) { fail(code); }
void mock_missing(int missing) { m.missing = missing; }
void mock_no_scheduler(int none) { m.no_scheduler = none; }
void mock_temperature(double share) { m.temperature = share; }
unsigned long mock_frames(void) { return m.frames; }
int mock_wait(unsigned long frames) { /* until the scheduler has served so many; 0 after a minute */
    struct timespec a_millisecond = {0, 1000000};
    for (int k = 0; k < 60000 && m.frames < frames; k++) nanosleep(&a_millisecond, 0);
    return m.frames >= frames;
}
int mock_is_counted(void) { return heap_open != 0; }
unsigned long mock_served(void) { return m.served; }
int mock_opened(void) { return m.opened; }
void mock_force(double *force) { /* what the motors give */
    for (int i = 0; i < 3; i++) force[i] = m.enabled && m.opened ? m.force[i] : 0.0;
}
void mock_tick(void) {
    if (m.running && m.callback && m.callback(m.data) == 0) m.callback = 0;
    m.served++;
}

/* The interface. */
unsigned hdInitDevice(const char *name) {
    if (m.missing || (name && strcmp(name, "Default Device") != 0)) { fail(0x0300); return 0xFFFFFFFFu; }
    if (m.opened) fail(0x0301);
    m.opened = 1;
    return 1;
}
void hdDisableDevice(unsigned device) { if (device != 1) fail(0x0104); m.opened = m.enabled = 0; }
void hdMakeCurrentDevice(unsigned device) { if (device != 1) fail(0x0104); }
void hdBeginFrame(unsigned device) { if (device != 1) fail(0x0104); if (m.begun) fail(0x0400); m.begun = 1; }
void hdEndFrame(unsigned device) { if (device != 1) fail(0x0104); if (!m.begun) fail(0x0401); m.begun = 0; m.frames++; }
void hdEnable(unsigned what) { if (what == 0x4000) m.enabled = 1; else if (what < 0x4000 || what > 0x4004) fail(0x0100); }
void hdDisable(unsigned what) { if (what == 0x4000) m.enabled = 0; }
void hdGetDoublev(unsigned what, double *out) {
    switch (what) {
    case 0x2050: memcpy(out, m.position, 24); break;
    case 0x2051: memcpy(out, m.velocity, 24); break;
    case 0x2052: memcpy(out, m.transform, 128); break;
    case 0x2150: memcpy(out, m.gimbal, 24); break;
    case 0x2603: *out = m.largest; break;
    case 0x2605: for (int i = 0; i < 6; i++) out[i] = i == 2 ? m.temperature : 0.1; break;
    default: fail(0x0100);
    }
}
void hdGetIntegerv(unsigned what, int *out) {
    if (what == 0x2000) *out = m.buttons;
    else if (what == 0x2555) *out = m.style;
    else fail(0x0100);
}
const char *hdGetString(unsigned what) { return what == 0x2501 ? "Mock Premium" : what == 0x2504 ? "M-42" : 0; }
void hdSetDoublev(unsigned what, const double *in) {
    if (what != 0x2700) { fail(0x0100); return; }
    if (!m.begun) fail(0x0102);
    memcpy(m.force, in, 24);
    if (in[0] * in[0] + in[1] * in[1] + in[2] * in[2] > m.largest * m.largest * (1.0 + 1e-9)) fail(0x0201);
}
HDErrorInfo hdGetError(void) {
    HDErrorInfo info = {0, 0, 1};
    if (m.first < m.last) info.errorCode = m.errors[m.first++ % 32];
    return info;
}
const char *hdGetErrorString(unsigned code) { return code ? "an error" : "none"; }
unsigned hdCheckCalibration(void) { return m.calibration; }
void hdUpdateCalibration(unsigned style) { if (style != (unsigned)m.style) fail(0x0101); else if (m.calibration == 0x5001) m.calibration = 0x5000; }
void hdSetSchedulerRate(unsigned long rate) { m.rate = rate; if (rate != 1000 && rate != 500) fail(0x0101); }
static void *serve(void *unused) {
    struct timespec period = {0, 1000000000L / (long)m.rate};
    (void)unused;
    if (heap_open) heap_open();
    while (m.running) { mock_tick(); nanosleep(&period, 0); }
    return 0;
}
void hdStartScheduler(void) {
    if (m.no_scheduler) { fail(0x0304); return; }
    m.running = 1;
    if (!m.manual) pthread_create(&m.thread, 0, serve, 0);
}
void hdStopScheduler(void) {
    int threaded = m.running && !m.manual;
    m.running = 0;
    if (threaded) pthread_join(m.thread, 0);
}
unsigned long hdScheduleAsynchronous(Callback callback, void *data, unsigned short priority) {
    m.callback = callback; m.data = data; m.priority = priority;
    return 7;
}
void hdUnschedule(unsigned long task) { if (task != 7) fail(0x0104); m.callback = 0; }
