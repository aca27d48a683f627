/* Force Dimension's DHD as far as it is used, with a device whose pose and faults the test sets. */
#include <string.h>

static struct {
    double position[3], frame[9], force[3];
    int button, enabled, opened, error, missing, guard;
    unsigned char watchdog;
} m;

void mock_reset(void) {
    memset(&m, 0, sizeof m);
    for (int i = 0; i < 3; i++) m.frame[4 * i] = 1.0;
}
void mock_pose(const double *position, const double *frame) {
    memcpy(m.position, position, sizeof m.position);
    memcpy(m.frame, frame, sizeof m.frame);
}
void mock_button(int pressed) { m.button = pressed; }
void mock_error(int error) { m.error = error; }
void mock_missing(int missing) { m.missing = missing; }
void mock_guard(int guard) { m.guard = guard; }
int mock_watchdog(void) { return m.watchdog; }
int mock_enabled(void) { return m.enabled; }
int mock_opened(void) { return m.opened; }
void mock_force(double *force) {
    for (int i = 0; i < 3; i++) force[i] = m.enabled && m.opened ? m.force[i] : 0.0;
}

static int ok(char id) { return m.opened && id == 2 && !m.error ? 0 : -1; }

int dhdOpen(void) {
    if (m.missing) { m.error = 5; return -1; }
    m.opened = 1;
    return 2;
}
int dhdClose(char id) { int result = ok(id); m.opened = m.enabled = 0; return result; }
const char *dhdGetSystemName(char id) { return id == 2 ? "mock omega.6" : 0; }
int dhdGetSerialNumber(unsigned short *serial, char id) { *serial = 321; return ok(id); }
int dhdGetPositionAndOrientationFrame(double *x, double *y, double *z, double *frame, char id) {
    *x = m.position[0]; *y = m.position[1]; *z = m.position[2];
    memcpy(frame, m.frame, sizeof m.frame);
    return ok(id) ? -1 : m.guard;
}
int dhdGetButton(int index, char id) { return ok(id) || index != 0 ? -1 : m.button; }
int dhdSetForce(double x, double y, double z, char id) {
    if (ok(id)) return -1;
    m.force[0] = x; m.force[1] = y; m.force[2] = z;
    return 0;
}
int dhdEnableForce(unsigned char on, char id) { if (ok(id)) return -1; m.enabled = on; return 0; }
int dhdSetWatchdog(unsigned char units, char id) { if (ok(id)) return -1; m.watchdog = units; return 0; }
int dhdErrorGetLast(void) { return m.error; }
const char *dhdErrorGetLastStr(void) { return m.error ? "mock error" : "no error"; }
