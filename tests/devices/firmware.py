"""The reference firmware as a shared library, and a HID handle that takes hidapi's place in front of it."""

import ctypes
import shutil
import subprocess
from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from models.phantom.parameters import PREMIUM_1_5
from sim.devices import hid_protocol as protocol

ROOT = Path(__file__).resolve().parents[2]
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
NO_SENSOR = protocol.NO_TEMPERATURE


def compile_c(folder: Path, *sources: Path, program: bool = False) -> Path:
    """Compile C files to a library or a program; the test is skipped where there is no compiler."""
    if COMPILER is None:
        pytest.skip("no C compiler (cc, gcc or clang)")
    target = folder / (sources[0].stem if program else f"lib{sources[0].stem}.so")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", *([] if program else ["-shared", "-fPIC"])]
    subprocess.run([COMPILER, *flags, "-o", str(target), *map(str, sources), "-lpthread"], check=True)
    return target


class Sensors(ctypes.Structure):
    _fields_ = [
        ("time_us", ctypes.c_uint64), ("encoder", ctypes.c_int32 * 6), ("temperature", ctypes.c_int16 * 3),
        ("pressed", ctypes.c_uint8), ("amplifier_fault", ctypes.c_uint8), ("encoder_fault", ctypes.c_uint8),
    ]  # fmt: skip


class Motors(ctypes.Structure):
    _fields_ = [("on", ctypes.c_uint8), ("torque", ctypes.c_int32 * 3)]


def identity(watchdog_max_us: int = 100_000) -> np.ndarray:
    record = protocol.empty_report(protocol.IDENTITY)
    record["capabilities"] = (
        protocol.HAS_MOTORS | protocol.HAS_WATCHDOG | protocol.HAS_TEMPERATURE | protocol.HAS_GIMBAL
    )
    record["rate_hz"], record["watchdog_max_us"] = 1000, watchdog_max_us
    record["peak_torque"] = round(PREMIUM_1_5.stall_motor_torque / protocol.PEAK_UNIT)
    record["name"], record["firmware"], record["serial"] = b"Reference", b"1.0", b"HVF-0001"
    return record


def calibration() -> np.ndarray:
    record = protocol.empty_report(protocol.CALIBRATION)
    record["flags"] = protocol.CALIBRATED
    turns = [*PREMIUM_1_5.capstan, 1.0, 1.0, 1.0]
    counts = [PREMIUM_1_5.encoder_counts] * 3 + [PREMIUM_1_5.gimbal_counts] * 3
    record["zero"] = [1000, -2000, 3000, 0, 100, -100]
    record["counts_per_turn"] = np.rint(np.multiply(turns, counts) / protocol.COUNT_UNIT)
    record["motor_turns"] = np.rint(np.array(PREMIUM_1_5.capstan) / protocol.TURN_UNIT)
    return record


def output_report(enable: bool, boot: int, sequence: int, watchdog_us: int, torque: list[int], answers: int) -> bytes:
    record = protocol.empty_report(protocol.OUTPUT)
    record["flags"], record["boot"], record["sequence"] = protocol.ENABLE if enable else 0, boot, sequence
    record["watchdog_us"], record["torque"], record["answers"] = watchdog_us, torque, answers
    return protocol.encode_report(record)


class Firmware:
    """The C state machine of `firmware/hvf_hid.c`, stepped from here, with sensors and motors as plain arrays."""

    def __init__(self, library: Path):
        c = ctypes.CDLL(str(library))
        c.hvf_give_feature.restype = ctypes.c_size_t
        c.hvf_take_output.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_uint64]
        c.hvf_take_feature.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t]
        self.c, self.boot = c, 0
        self.device = ctypes.create_string_buffer(1024)
        self.sensors, self.motors = Sensors(), Motors()
        self.sensors.temperature[:] = [3000, 3100, NO_SENSOR]
        self.zero = calibration()["zero"].astype(int)
        self.angle = 2.0 * np.pi / (calibration()["counts_per_turn"] * protocol.COUNT_UNIT)
        self.power_up()

    def power_up(self, calibrated: bool = True) -> None:
        """Switch power off and on; incremental encoders then have lost their zero (`calibrated` false)."""
        self.boot += 1
        self.sensors.time_us = 0
        stored = calibration()
        stored["flags"] = protocol.CALIBRATED if calibrated else 0
        self.c.hvf_begin(self.device, identity().tobytes(), stored.tobytes(), ctypes.c_uint16(self.boot))

    def descriptor(self) -> bytes:
        """HID report descriptor."""
        size = ctypes.c_size_t.in_dll(self.c, "hvf_report_descriptor_size").value
        return bytes((ctypes.c_uint8 * size).in_dll(self.c, "hvf_report_descriptor"))

    def take(self, report: bytes) -> bool:
        if report[0] == protocol.OUTPUT:
            taken = self.c.hvf_take_output(self.device, report, len(report), self.sensors.time_us)
            self.c.hvf_drive(self.device, ctypes.byref(self.motors))
            return bool(taken)
        return bool(self.c.hvf_take_feature(self.device, report, len(report)))

    def feature(self, number: int) -> bytes:
        buffer = ctypes.create_string_buffer(64)
        size = self.c.hvf_give_feature(self.device, ctypes.c_uint8(number), buffer)
        return buffer.raw[:size]

    def tick(self, period: float = 1e-3) -> bytes:
        """Advance by a period; returns the input report."""
        self.sensors.time_us += round(period * 1e6)
        buffer = ctypes.create_string_buffer(64)
        self.c.hvf_tick(self.device, ctypes.byref(self.sensors), buffer)
        self.c.hvf_drive(self.device, ctypes.byref(self.motors))
        return buffer.raw

    def turn_to(self, angles: np.ndarray) -> None:
        """Set the encoder counts to joint and gimbal angles [rad], shape (6,)."""
        self.sensors.encoder[:] = (np.rint(angles / self.angle).astype(int) + self.zero).tolist()

    @property
    def joint_torque(self) -> np.ndarray:
        """Motor torques at the joints [N m]; zero while the motors are off."""
        shaft = np.array(self.motors.torque[:]) * protocol.TORQUE_UNIT if self.motors.on else np.zeros(3)
        return shaft * PREMIUM_1_5.capstan


class FirmwareHandle:
    """A handle like hidapi's with the firmware behind it; `tamper` alters its reports. No time passes in it."""

    def __init__(self, firmware: Firmware):
        self.firmware, self.queue, self.plugged = firmware, deque[bytes](), True
        self.tamper: Callable[[bytes], list[bytes]] = lambda report: [report]

    def tick(self) -> None:
        """Advance the device by a period and queue its report."""
        self.queue.extend(self.tamper(self.firmware.tick()))

    def read(self, max_length: int, timeout_ms: int = 0) -> list[int]:
        if not self.plugged:
            raise OSError("read error")
        return list(self.queue.popleft()[:max_length]) if self.queue else []

    def write(self, buff: bytes) -> int:
        if not self.plugged:
            return -1
        self.firmware.take(buff)
        return len(buff)

    def get_feature_report(self, report_num: int, max_length: int) -> list[int]:
        if not self.plugged:
            raise OSError("read error")
        return list(self.firmware.feature(report_num)[:max_length])

    def send_feature_report(self, buff: bytes) -> int:
        self.firmware.take(buff)
        return len(buff)

    def set_nonblocking(self, value: bool) -> int:
        return 0

    def close(self) -> None:
        self.plugged = False
