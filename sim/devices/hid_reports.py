"""Checking of input reports and encoding of output reports of the open HID protocol, compiled and allocation-free.

The layouts are those of `sim.devices.hid_protocol`, by which compiled code reads and writes the fields of a buffer.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.safety.faults import Fault, first_not_finite
from geometry.arrays import Array, IntArray
from sim.compilation.compiled import entry_point
from sim.devices import hid_protocol as protocol
from sim.devices.driver import LOST, READ, REFUSED, ROUND_TRIP, TEMPERATURE, note_arrival
from sim.devices.exchange import READING_CLOCK, READING_SEQUENCE, READING_SIZE, READING_SWITCH, READING_THETA

WATCHDOG_TIME = 0.01
"""Watchdog period: time without a command after which the firmware switches the motors off [s]. Twice the age at which
a command becomes invalid on the host, so that the firmware acts only where the host failed to."""
MAX_TEMPERATURE = 100.0
"""Motor temperature that is a fault [°C]: 25 below what Maxon allows an RE 25's winding."""
_BAD_CHECKSUM_LIMIT = 3  # consecutive wrong checksums that are a fault; a disturbance spoils one or two
_SEND_TIME_COUNT = 256  # commands whose time of sending is stored, to measure the round trip
_STATUS_ERRORS = protocol.STATUS_AMPLIFIER | protocol.STATUS_ENCODER

N_LAST, N_TAKEN, N_BAD, N_SENT, N_ENABLED, N_REENABLE, N_BOOT, N_WATCHDOG, N_SIZE = range(9)
"""Places in `HidMemory.numbers`: number of the last input report (−1: none); readings handed out; reports in a row with
a wrong checksum; commands sent; number of the command that switched the motors on (−1: off); 1 if the watchdog switched
them off during a gap, so that one command with motors off must precede the next with motors on; the device's boot
number; and the watchdog's period [µs]."""
IO_FAULT, IO_VALUE, IO_NEW, IO_SIZE, IO_NOW, IO_READING_TIME, IO_ENABLE = range(7)
IO_ENABLE_TIME, IO_ENABLE_DEVICE_TIME, IO_LENGTH = 7, 8, 9
"""Places in `HidMemory.io`: fault of a report or a command, with its value; 1 if a report was a new reading; size of
the report [bytes]; time by the host's clock; time of the last reading handed out by the device's clock [s]; 1 if the
motors are to be on; both times when the motors were last commanded on."""

_REPORT_MALFORMED, _CHECKSUM_WRONG = int(Fault.REPORT_MALFORMED), int(Fault.CHECKSUM_WRONG)
_DEVICE_RESET, _SEQUENCE_BACK, _TOO_HOT = int(Fault.DEVICE_RESET), int(Fault.SEQUENCE_BACK), int(Fault.OVER_TEMPERATURE)
_DEVICE_REPORTED, _FORCE_NOT_FINITE = int(Fault.DEVICE_REPORTED), int(Fault.FORCE_NOT_FINITE)
_MOTORS_OFF = int(Fault.MOTORS_OFF)


def _crc_table() -> IntArray:
    """Table of CRC-32/ISO-HDLC: remainder of each byte by the reflected polynomial 0xEDB88320."""
    remainder = np.arange(256, dtype=np.int64)
    for _ in range(8):
        remainder = np.where(remainder & 1, (remainder >> 1) ^ 0xEDB88320, remainder >> 1)
    return remainder


_CRC_TABLE = _crc_table()


@njit
def checksum(report: npt.NDArray[np.uint8]) -> int:
    """CRC-32 of all bytes of a report before its checksum field."""
    remainder = 0xFFFFFFFF
    for k in range(protocol.CRC_OFFSET):
        remainder = (remainder >> 8) ^ _CRC_TABLE[(remainder ^ np.int64(report[k])) & 0xFF]
    return remainder ^ 0xFFFFFFFF


class HidMemory(NamedTuple):
    """The state of a device in compiled code.

    Attributes
    ----------
    received, sent : array of uint8
        Bytes of the last input report, with room for eight more so that one that is too long shows, and of the next
        output report.
    incoming, outgoing : array
        The same as records, shape (1,): `hid_protocol.INPUT_REPORT` and `OUTPUT_REPORT`.
    numbers : IntArray
        See `N_LAST`.
    io : Array
        Arguments and results of the kernels, see `IO_FAULT`.
    zero, angle : Array
        Encoder counts at angle zero, and the angle of a count [rad], shape (6,).
    turns, peak : Array
        Motor turns per joint turn, and the motors' peak torque [N m], shape (3,).
    torque : Array
        Joint torques to be commanded [N m], shape (3,).
    sent_at : Array
        Times at which commands were sent [s], a ring by command number, shape (256,).
    reading : Array
        The last reading.
    telemetry, clocks : Array
        Those of `sim.devices.driver.note_arrival`.
    """

    received: npt.NDArray[np.uint8]
    sent: npt.NDArray[np.uint8]
    incoming: npt.NDArray[Any]
    outgoing: npt.NDArray[Any]
    numbers: IntArray
    io: Array
    zero: Array
    angle: Array
    turns: Array
    peak: Array
    torque: Array
    sent_at: Array
    reading: Array
    telemetry: Array
    clocks: Array

    @classmethod
    def fresh(cls, telemetry: Array) -> "HidMemory":
        """Memory before the first report; identity and calibration of the device are not read yet."""
        numbers, io = np.zeros(N_SIZE, np.int64), np.zeros(IO_LENGTH)
        received, sent = np.zeros(protocol.REPORT_SIZE + 8, np.uint8), np.zeros(protocol.REPORT_SIZE, np.uint8)
        numbers[[N_LAST, N_ENABLED]], io[IO_READING_TIME] = -1, math.nan
        incoming = received[: protocol.REPORT_SIZE].view(protocol.INPUT_REPORT)
        outgoing = sent.view(protocol.OUTPUT_REPORT)
        return cls(
            received, sent, incoming, outgoing, numbers, io, np.zeros(6), np.zeros(6), np.zeros(3), np.zeros(3),
            np.zeros(3), np.full(_SEND_TIME_COUNT, np.nan), np.zeros(READING_SIZE), telemetry, np.full(3, np.nan),
        )  # fmt: skip


@njit
def _set_fault(io: Array, code: int, value: float) -> None:
    if io[IO_FAULT] == 0.0:
        io[IO_FAULT], io[IO_VALUE] = code, value


@entry_point
def judge_report(hid: HidMemory) -> None:
    """Check the input report that was received; write its reading, and the result to `io`."""
    io, numbers, telemetry, report = hid.io, hid.numbers, hid.telemetry, hid.incoming[0]
    io[IO_FAULT] = io[IO_NEW] = 0.0
    if io[IO_SIZE] != protocol.REPORT_SIZE or report.report != protocol.INPUT:
        telemetry[REFUSED] += 1.0
        _set_fault(io, _REPORT_MALFORMED, io[IO_SIZE])
        return
    if checksum(hid.received) != report.crc:
        telemetry[REFUSED] += 1.0
        numbers[N_BAD] += 1
        if numbers[N_BAD] >= _BAD_CHECKSUM_LIMIT:
            _set_fault(io, _CHECKSUM_WRONG, numbers[N_BAD])
        return
    numbers[N_BAD] = 0
    if report.boot != numbers[N_BOOT]:
        _set_fault(io, _DEVICE_RESET, 0.0)
        return
    answered, status = np.int64(report.answered), np.int64(report.status)
    if numbers[N_LAST] < 0:
        # A device last used by another program continues that program's numbers; its watchdog may have acted since.
        if answered > numbers[N_SENT]:
            numbers[N_SENT] = answered
        numbers[N_REENABLE] = 1 if status & protocol.STATUS_WATCHDOG else 0
    if not _is_next(hid, np.int64(report.sequence)):
        return
    measured_at = np.int64(report.time_us) * 1e-6
    for i in range(6):
        hid.reading[READING_THETA + i] = (np.int64(report.encoder[i]) - hid.zero[i]) * hid.angle[i]
    hid.reading[READING_SWITCH] = report.flags & protocol.SWITCH
    hid.reading[READING_CLOCK] = measured_at
    numbers[N_TAKEN] += 1
    hid.reading[READING_SEQUENCE] = numbers[N_TAKEN]
    _update_telemetry(hid, measured_at, answered)
    _judge_temperature(hid, status)
    if status & _STATUS_ERRORS:
        _set_fault(io, _DEVICE_REPORTED, float(status & _STATUS_ERRORS))
    if io[IO_FAULT] == 0.0:
        _judge_motors(hid, measured_at, answered, status)
    io[IO_NEW] = 1.0 if io[IO_FAULT] == 0.0 else 0.0


@njit
def _sequence_difference(number: np.int64, reference: np.int64) -> np.int64:
    """Signed difference of two 32-bit sequence numbers, which wrap around."""
    return (number - reference + 2**31) % 2**32 - 2**31


@njit
def _is_next(hid: HidMemory, number: np.int64) -> bool:
    """Whether a report's number is ahead of the last one's; a repeated number is refused, an older one is a fault."""
    last, telemetry = hid.numbers[N_LAST], hid.telemetry
    ahead = 1 if last < 0 else _sequence_difference(number, last)
    if ahead <= 0:
        telemetry[REFUSED] += 1.0
        if ahead < 0:
            _set_fault(hid.io, _SEQUENCE_BACK, float(-ahead))
        return False
    telemetry[LOST] += ahead - 1.0
    telemetry[READ] += 1.0
    hid.numbers[N_LAST] = number
    return True


@njit
def _update_telemetry(hid: HidMemory, measured_at: float, answered: np.int64) -> None:
    """Update the telemetry: temperatures, round trip, jitter and staleness."""
    telemetry, now = hid.telemetry, hid.io[IO_NOW]
    for i in range(3):
        celsius = np.int64(hid.incoming[0].temperature[i])
        telemetry[TEMPERATURE + i] = (
            np.nan if celsius == protocol.NO_TEMPERATURE else celsius * protocol.TEMPERATURE_UNIT
        )
    if 0 <= _sequence_difference(hid.numbers[N_SENT], answered) < _SEND_TIME_COUNT:
        held = np.int64(hid.incoming[0].held_us)
        telemetry[ROUND_TRIP] = now - hid.sent_at[answered % _SEND_TIME_COUNT] - held * 1e-6
    note_arrival(telemetry, hid.clocks, now, measured_at)


@njit
def _judge_temperature(hid: HidMemory, status: np.int64) -> None:
    hottest = -np.inf
    for i in range(3):
        celsius = hid.telemetry[TEMPERATURE + i]
        if celsius > hottest:  # false for NaN, a motor without a sensor
            hottest = celsius
    if status & protocol.STATUS_HOT or hottest >= MAX_TEMPERATURE:
        _set_fault(hid.io, _TOO_HOT, hottest)


@njit
def _judge_motors(hid: HidMemory, measured_at: float, answered: np.int64, status: np.int64) -> None:
    """Check motors that are off although they were commanded on.

    Either the firmware's watchdog switched them off: after a gap in the readings they may be switched on again, since
    the servo ramps the force in after a gap; without a gap, commands did not arrive, which is a fault. Or they were
    never switched on: a fault once the waiting time has passed by both clocks, since either side may have been
    suspended between a reading and its command.
    """
    io, enable_command = hid.io, hid.numbers[N_ENABLED]
    if enable_command < 0 or status & protocol.STATUS_ENABLED:
        return
    if status & protocol.STATUS_WATCHDOG and _sequence_difference(answered, enable_command) >= 0:
        if measured_at - io[IO_READING_TIME] > 0.5 * WATCHDOG_TIME:
            hid.numbers[N_REENABLE] = 1
        else:
            _set_fault(io, _DEVICE_REPORTED, protocol.STATUS_WATCHDOG)
        return
    waited = min(io[IO_NOW] - io[IO_ENABLE_TIME], measured_at - io[IO_ENABLE_DEVICE_TIME])
    if waited > WATCHDOG_TIME:
        _set_fault(io, _MOTORS_OFF, waited)


@entry_point
def make_command(hid: HidMemory) -> None:
    """Write the next output report, with torques limited to the motors' peak; none if a torque is not finite."""
    io, numbers, report = hid.io, hid.numbers, hid.outgoing[0]
    io[IO_FAULT] = 0.0
    bad_value = first_not_finite(hid.torque)
    if bad_value != 0.0:
        _set_fault(io, _FORCE_NOT_FINITE, bad_value)
        return
    numbers[N_SENT] += 1
    enable = io[IO_ENABLE] > 0.0 and numbers[N_REENABLE] == 0
    numbers[N_REENABLE] = 0
    if not enable:
        numbers[N_ENABLED] = -1
    elif numbers[N_ENABLED] < 0:
        numbers[N_ENABLED] = numbers[N_SENT]
        io[IO_ENABLE_TIME], io[IO_ENABLE_DEVICE_TIME] = io[IO_NOW], io[IO_READING_TIME]
    report.report, report.flags = protocol.OUTPUT, protocol.ENABLE if enable else 0
    report.boot, report.sequence = numbers[N_BOOT], numbers[N_SENT] % 2**32
    report.watchdog_us, report.answers = numbers[N_WATCHDOG], max(0, numbers[N_LAST])
    for i in range(3):
        motor_torque = min(max(hid.torque[i] / hid.turns[i], -hid.peak[i]), hid.peak[i]) if enable else 0.0
        report.torque[i] = int(np.rint(motor_torque / protocol.TORQUE_UNIT))
    report.crc = checksum(hid.sent)
    hid.sent_at[numbers[N_SENT] % _SEND_TIME_COUNT] = io[IO_NOW]
