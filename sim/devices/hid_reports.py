"""Reports of the open HID protocol, judged and made by compiled code: the servo's tick takes no memory for them.

The layouts are those of `sim.devices.hid_protocol`: every field is aligned, so a buffer is looked at as bytes and as
whole numbers of each size. The host is little-endian, as the protocol is.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.safety.faults import Fault, first_not_finite
from controllers.state import Array, IntArray
from sim.compilation.compiled import entry_point
from sim.devices import hid_protocol as protocol
from sim.devices.driver import BAD, LOST, READ, ROUND_TRIP, TEMPERATURE, note_arrival
from sim.devices.exchange import READING_CLOCK, READING_SEQUENCE, READING_SIZE, READING_SWITCH, READING_THETA

WATCHDOG = 0.01
"""Time without a command after which the firmware switches the motors off [s]: twice the silence after which a command
is no longer valid here, so that it acts when this process no longer can, and not before."""
HOTTEST = 100.0
"""Motor temperature that is a fault [°C]: 25 below what Maxon allows an RE 25's winding."""
_BAD_IN_ROW = 3  # a disturbance spoils one report or two; a cable or a device that is broken goes on
_SENT = 256  # commands whose time is kept, for the round trip
_ERRORS = protocol.STATUS_AMPLIFIER | protocol.STATUS_ENCODER

N_LAST, N_TAKEN, N_BAD, N_SENT, N_ENABLED, N_AGAIN, N_BOOT, N_WATCHDOG, N_SIZE = range(9)
"""Number of the last input report (−1: none), readings handed out, reports in a row whose checksum was wrong, commands
sent, number of the command that switched the motors on (−1: off), 1 where they went off while nobody was there and are
to be switched off, then on, the device's boot, and the watchdog's period [µs]."""
TOLD_FAULT, TOLD_VALUE, TOLD_NEW, TOLD_SIZE, TOLD_NOW, TOLD_GIVEN, TOLD_ENABLE = range(7)
TOLD_ASKED, TOLD_ASKED_MADE, TOLD_LENGTH = 7, 8, 9
"""What is wrong with a report or a command, with its value; 1 where a report was a new reading; bytes of a report; the
time by the host's clock, and the device's of the reading that was handed out last [s]; 1 to switch the motors on; both
times as they were when the motors were told to switch on."""

_PLACES = {
    record: {name: field[1] for name, field in (layout.fields or {}).items()}
    for record, layout in ((protocol.INPUT, protocol.INPUT_REPORT), (protocol.OUTPUT, protocol.OUTPUT_REPORT))
}
_STATUS, _BOOT = _PLACES[protocol.INPUT]["status"] // 2, _PLACES[protocol.INPUT]["boot"] // 2
_SEQUENCE, _TIME = _PLACES[protocol.INPUT]["sequence"] // 4, _PLACES[protocol.INPUT]["time_us"] // 8
_ENCODER, _CELSIUS = _PLACES[protocol.INPUT]["encoder"] // 4, _PLACES[protocol.INPUT]["temperature"] // 2
_ANSWERED, _HELD = _PLACES[protocol.INPUT]["answered"] // 4, _PLACES[protocol.INPUT]["held_us"] // 4
_CRC, _CRC_BYTES = _PLACES[protocol.INPUT]["crc"] // 4, _PLACES[protocol.INPUT]["crc"]
_OUT_BOOT, _OUT_SEQUENCE = _PLACES[protocol.OUTPUT]["boot"] // 2, _PLACES[protocol.OUTPUT]["sequence"] // 4
_OUT_WATCHDOG, _OUT_TORQUE = _PLACES[protocol.OUTPUT]["watchdog_us"] // 4, _PLACES[protocol.OUTPUT]["torque"] // 4
_OUT_ANSWERS = _PLACES[protocol.OUTPUT]["answers"] // 4
_SIZE, _INPUT, _OUTPUT, _ENABLE, _SWITCH = protocol.REPORT_SIZE, protocol.INPUT, protocol.OUTPUT, 1, protocol.SWITCH
_STATUS_WATCHDOG, _STATUS_HOT, _STATUS_ENABLED = protocol.STATUS_WATCHDOG, protocol.STATUS_HOT, protocol.STATUS_ENABLED
_NO_CELSIUS = protocol.NO_TEMPERATURE
_CELSIUS_UNIT, _TORQUE_UNIT = protocol.TEMPERATURE_UNIT, protocol.TORQUE_UNIT

_MALFORMED, _CHECKSUM = int(Fault.REPORT_MALFORMED), int(Fault.CHECKSUM_WRONG)
_RESET, _BACK, _HOT = int(Fault.DEVICE_RESET), int(Fault.SEQUENCE_BACK), int(Fault.OVER_TEMPERATURE)
_REPORTED, _NOT_FINITE = int(Fault.DEVICE_REPORTED), int(Fault.FORCE_NOT_FINITE)
_MOTORS_OFF = int(Fault.MOTORS_OFF)


def _remainders() -> IntArray:
    """CRC-32/ISO-HDLC of each byte: remainders by the polynomial 0xEDB88320, lowest bit first."""
    rest = np.arange(256, dtype=np.int64)
    for _ in range(8):
        rest = np.where(rest & 1, (rest >> 1) ^ 0xEDB88320, rest >> 1)
    return rest


_REMAINDERS = _remainders()


@njit
def checksum(report: npt.NDArray[np.uint8]) -> int:
    """CRC-32 of all of a report that comes before it."""
    rest = 0xFFFFFFFF
    for k in range(_CRC_BYTES):
        rest = (rest >> 8) ^ _REMAINDERS[(rest ^ np.int64(report[k])) & 0xFF]
    return rest ^ 0xFFFFFFFF


class Words(NamedTuple):
    """A buffer as bytes, and as whole numbers of two, four and eight, each with and without sign as the layouts ask."""

    u8: npt.NDArray[Any]
    u16: npt.NDArray[Any]
    i16: npt.NDArray[Any]
    u32: npt.NDArray[Any]
    i32: npt.NDArray[Any]
    u64: npt.NDArray[Any]

    @classmethod
    def fresh(cls) -> "Words":
        """A buffer of zeros, with room that shows a report that is too long."""
        buffer = np.zeros(_SIZE + 8, np.uint8)
        kinds = (np.uint8, np.uint16, np.int16, np.uint32, np.int32, np.uint64)
        return cls(*(buffer.view(kind) for kind in kinds))


class HidMemory(NamedTuple):
    """A device as compiled code holds it.

    Attributes
    ----------
    incoming, outgoing : Words
        The last input report, and the next output report.
    numbers : IntArray
        See `N_LAST`.
    told : Array
        See `TOLD_FAULT`.
    zero, angle : Array
        Counts at angle zero, and the angle of a count [rad], shape (6,).
    turns, peak : Array
        Motor turns a joint turn, and the motors' peak torque [N m], shape (3,).
    torque : Array
        Of the joints, that is commanded [N m], shape (3,).
    sent_at : Array
        When commands were sent [s], shape (256,).
    reading, telemetry, clocks : Array
        The last reading; of `sim.devices.driver`.
    """

    incoming: Words
    outgoing: Words
    numbers: IntArray
    told: Array
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
        """Before the first report, of a device whose identity and calibration are not read yet."""
        numbers, told = np.zeros(N_SIZE, np.int64), np.zeros(TOLD_LENGTH)
        numbers[[N_LAST, N_ENABLED]], told[TOLD_GIVEN] = -1, math.nan
        return cls(
            Words.fresh(), Words.fresh(), numbers, told, np.zeros(6), np.zeros(6), np.zeros(3), np.zeros(3),
            np.zeros(3), np.full(_SENT, np.nan), np.zeros(READING_SIZE), telemetry, np.full(3, np.nan),
        )  # fmt: skip


@njit
def _fault(told: Array, code: int, value: float) -> None:
    if told[TOLD_FAULT] == 0.0:
        told[TOLD_FAULT], told[TOLD_VALUE] = code, value


@entry_point
def judge_report(hid: HidMemory) -> None:
    """Judge the input report that has come, and write the reading that it has; what it is is told."""
    told, numbers, telemetry, words = hid.told, hid.numbers, hid.telemetry, hid.incoming
    told[TOLD_FAULT] = told[TOLD_NEW] = 0.0
    if told[TOLD_SIZE] != _SIZE or words.u8[0] != _INPUT:
        telemetry[BAD] += 1.0
        _fault(told, _MALFORMED, told[TOLD_SIZE])
        return
    if checksum(words.u8) != np.int64(words.u32[_CRC]):
        telemetry[BAD] += 1.0
        numbers[N_BAD] += 1
        if numbers[N_BAD] >= _BAD_IN_ROW:
            _fault(told, _CHECKSUM, numbers[N_BAD])
        return
    numbers[N_BAD] = 0
    if np.int64(words.u16[_BOOT]) != numbers[N_BOOT]:
        _fault(told, _RESET, 0.0)
        return
    answered, status = np.int64(words.u32[_ANSWERED]), np.int64(words.u16[_STATUS])
    if numbers[N_LAST] < 0:
        # It goes on where another program stopped: with its numbers, and motors that its silence switched off.
        if answered > numbers[N_SENT]:
            numbers[N_SENT] = answered
        numbers[N_AGAIN] = 1 if status & _STATUS_WATCHDOG else 0
    if not _is_next(hid, np.int64(words.u32[_SEQUENCE])):
        return
    made = np.int64(words.u64[_TIME]) * 1e-6
    for i in range(6):
        hid.reading[READING_THETA + i] = (np.int64(words.i32[_ENCODER + i]) - hid.zero[i]) * hid.angle[i]
    hid.reading[READING_SWITCH] = words.u8[1] & _SWITCH
    hid.reading[READING_CLOCK] = made
    numbers[N_TAKEN] += 1
    hid.reading[READING_SEQUENCE] = numbers[N_TAKEN]
    _measure(hid, made, answered)
    _judge_temperature(hid, status)
    if status & _ERRORS:
        _fault(told, _REPORTED, float(status & _ERRORS))
    if told[TOLD_FAULT] == 0.0:
        _judge_motors(hid, made, answered, status)
    told[TOLD_NEW] = 1.0 if told[TOLD_FAULT] == 0.0 else 0.0


@njit
def _ahead(number: np.int64, of: np.int64) -> np.int64:
    """How far a number of 32 bits, which wraps, is ahead of another."""
    return (number - of + 2**31) % 2**32 - 2**31


@njit
def _is_next(hid: HidMemory, number: np.int64) -> bool:
    """Whether a report's number is ahead of the last one's; the same one again is refused, an older one a fault."""
    last, telemetry = hid.numbers[N_LAST], hid.telemetry
    ahead = 1 if last < 0 else _ahead(number, last)
    if ahead <= 0:
        telemetry[BAD] += 1.0
        if ahead < 0:
            _fault(hid.told, _BACK, float(-ahead))
        return False
    telemetry[LOST] += ahead - 1.0
    telemetry[READ] += 1.0
    hid.numbers[N_LAST] = number
    return True


@njit
def _measure(hid: HidMemory, made: float, answered: np.int64) -> None:
    """Note temperatures, round trip, jitter and staleness."""
    telemetry, now = hid.telemetry, hid.told[TOLD_NOW]
    for i in range(3):
        celsius = np.int64(hid.incoming.i16[_CELSIUS + i])
        telemetry[TEMPERATURE + i] = np.nan if celsius == _NO_CELSIUS else celsius * _CELSIUS_UNIT
    if 0 <= _ahead(hid.numbers[N_SENT], answered) < _SENT:
        held = np.int64(hid.incoming.u32[_HELD])
        telemetry[ROUND_TRIP] = now - hid.sent_at[answered % _SENT] - held * 1e-6
    note_arrival(telemetry, hid.clocks, now, made)


@njit
def _judge_temperature(hid: HidMemory, status: np.int64) -> None:
    hottest = -np.inf
    for i in range(3):
        celsius = hid.telemetry[TEMPERATURE + i]
        if celsius > hottest:  # what is not a number is left out
            hottest = celsius
    if status & _STATUS_HOT or hottest >= HOTTEST:
        _fault(hid.told, _HOT, hottest)


@njit
def _judge_motors(hid: HidMemory, made: float, answered: np.int64, status: np.int64) -> None:
    """The motors are off that were told to be on.

    The firmware's watchdog switched them off: a fault where commands went out and did not arrive, and else a gap, after
    which who drives ramps the force in again, so they may be switched on again. Or they never came on: a fault once
    that is so by both clocks, for either side may stand still between a reading and its command.
    """
    told, since = hid.told, hid.numbers[N_ENABLED]
    if since < 0 or status & _STATUS_ENABLED:
        return
    if status & _STATUS_WATCHDOG and _ahead(answered, since) >= 0:
        if made - told[TOLD_GIVEN] > 0.5 * WATCHDOG:
            hid.numbers[N_AGAIN] = 1
        else:
            _fault(told, _REPORTED, _STATUS_WATCHDOG)
        return
    waited = min(told[TOLD_NOW] - told[TOLD_ASKED], made - told[TOLD_ASKED_MADE])
    if waited > WATCHDOG:
        _fault(told, _MOTORS_OFF, waited)


@entry_point
def make_command(hid: HidMemory) -> None:
    """Write the next output report, with the torque cut at the motors' peak; none for one that is not finite."""
    told, numbers, words = hid.told, hid.numbers, hid.outgoing
    told[TOLD_FAULT] = 0.0
    wrong = first_not_finite(hid.torque)
    if wrong != 0.0:
        _fault(told, _NOT_FINITE, wrong)
        return
    numbers[N_SENT] += 1
    enable = told[TOLD_ENABLE] > 0.0 and numbers[N_AGAIN] == 0
    numbers[N_AGAIN] = 0
    if not enable:
        numbers[N_ENABLED] = -1
    elif numbers[N_ENABLED] < 0:
        numbers[N_ENABLED] = numbers[N_SENT]
        told[TOLD_ASKED], told[TOLD_ASKED_MADE] = told[TOLD_NOW], told[TOLD_GIVEN]
    words.u8[0], words.u8[1] = _OUTPUT, _ENABLE if enable else 0
    words.u16[_OUT_BOOT], words.u32[_OUT_SEQUENCE] = numbers[N_BOOT], numbers[N_SENT] % 2**32
    words.u32[_OUT_WATCHDOG], words.u32[_OUT_ANSWERS] = numbers[N_WATCHDOG], max(0, numbers[N_LAST])
    for i in range(3):
        shaft = min(max(hid.torque[i] / hid.turns[i], -hid.peak[i]), hid.peak[i]) if enable else 0.0
        words.i32[_OUT_TORQUE + i] = int(np.rint(shaft / _TORQUE_UNIT))
    words.u32[_CRC] = checksum(words.u8)
    hid.sent_at[numbers[N_SENT] % _SENT] = told[TOLD_NOW]
