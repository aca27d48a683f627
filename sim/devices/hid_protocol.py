"""Layout of the 64-byte reports of the open HID protocol: `docs/reference/hid-protocol.md`; in C `firmware/hvf_hid.h`.

All integers are little-endian. Byte 0 is the report's number, the last four bytes are the CRC-32 of the 60 before them
(CRC-32/ISO-HDLC, as in Ethernet and zlib: at this length it detects every error of up to four bits, and every burst of
up to 32 bits).
"""

import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from sim.errors import SimError

REPORT_SIZE = 64
VERSION = (1, 0)
MAGIC = 0x31465648
USAGE_PAGE, USAGE = 0xFF48, 0x56
INPUT, OUTPUT, IDENTITY, CALIBRATION = 1, 2, 3, 4
SWITCH = ENABLE = CALIBRATED = 1

STATUS_ENABLED, STATUS_CALIBRATED, STATUS_WATCHDOG, STATUS_HOT = 1, 2, 4, 8
STATUS_AMPLIFIER, STATUS_ENCODER, STATUS_REFUSED = 16, 32, 64
HAS_MOTORS, HAS_WATCHDOG, HAS_TEMPERATURE, HAS_GIMBAL = 1, 2, 4, 8
NO_TEMPERATURE = -(2**15)

CRC_OFFSET = REPORT_SIZE - 4

INPUT_REPORT = np.dtype([
    ("report", "u1"), ("flags", "u1"), ("status", "<u2"), ("sequence", "<u4"), ("time_us", "<u8"),
    ("encoder", "<i4", 6), ("temperature", "<i2", 3), ("boot", "<u2"), ("answered", "<u4"), ("held_us", "<u4"),
    ("refused", "<u2"), ("reserved", "<u2"), ("crc", "<u4"),
])  # fmt: skip
OUTPUT_REPORT = np.dtype([
    ("report", "u1"), ("flags", "u1"), ("boot", "<u2"), ("sequence", "<u4"), ("watchdog_us", "<u4"),
    ("torque", "<i4", 3), ("answers", "<u4"), ("reserved", "u1", 32), ("crc", "<u4"),
])  # fmt: skip
IDENTITY_REPORT = np.dtype([
    ("report", "u1"), ("major", "u1"), ("minor", "u1"), ("reserved", "u1"), ("magic", "<u4"), ("capabilities", "<u4"),
    ("rate_hz", "<u2"), ("boot", "<u2"), ("watchdog_max_us", "<u4"), ("peak_torque", "<u2", 3), ("name", "S12"),
    ("firmware", "S8"), ("serial", "S14"), ("crc", "<u4"),
])  # fmt: skip
CALIBRATION_REPORT = np.dtype([
    ("report", "u1"), ("flags", "u1"), ("reserved", "<u2"), ("zero", "<i4", 6), ("counts_per_turn", "<i4", 6),
    ("motor_turns", "<u2", 3), ("reserved2", "<u2"), ("crc", "<u4"),
])  # fmt: skip
LAYOUTS = {INPUT: INPUT_REPORT, OUTPUT: OUTPUT_REPORT, IDENTITY: IDENTITY_REPORT, CALIBRATION: CALIBRATION_REPORT}

TORQUE_UNIT, PEAK_UNIT, TEMPERATURE_UNIT, COUNT_UNIT, TURN_UNIT = 1e-6, 1e-5, 0.01, 1e-3, 1e-3
"""Units of a torque [N m], a peak torque [N m], a temperature [°C], counts per turn, and motor turns per joint turn."""


def empty_report(report: int) -> npt.NDArray[Any]:
    """A report with the given number, all else zero: a record, shape ()."""
    record = np.zeros((), LAYOUTS[report])
    record["report"] = report
    return record


def encode_report(report: npt.NDArray[Any]) -> bytes:
    """A report's 64 bytes, including its checksum."""
    body = report.tobytes()[:CRC_OFFSET]
    return body + zlib.crc32(body).to_bytes(4, "little")


def has_valid_checksum(report: bytes) -> bool:
    """Whether the checksum of a report's 64 bytes is right."""
    return zlib.crc32(report[:CRC_OFFSET]) == int.from_bytes(report[CRC_OFFSET:], "little")


def decode_report(report: bytes, number: int) -> npt.NDArray[Any]:
    """Decode a feature report into its record.

    Raises
    ------
    SimError
        If it has the wrong size, number or checksum.
    """
    if len(report) != REPORT_SIZE or report[0] != number or not has_valid_checksum(report):
        raise SimError(
            f"feature report {number} has {len(report)} bytes"
            + (f" and number {report[0]}" if report else "")
            + f"; expected {REPORT_SIZE}, that number, and their CRC-32 (docs/reference/hid-protocol.md)"
        )
    return np.frombuffer(report, LAYOUTS[number])[0]
