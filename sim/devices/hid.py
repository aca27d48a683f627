r"""Driver for a Phantom that speaks the open HID protocol (`docs/reference/hid-protocol.md`), through hidapi.

Joint angles and motor torques follow from the calibration that the device stores:

.. math:: \theta_i = 2\pi\,(n_i - z_i)/N_i, \qquad \tau_{motor,i} = \tau_i/\eta_i

with n the encoder counts, z their zero, N counts per turn of the joint, η motor turns per turn of the joint.
"""

import contextlib
import math
import time
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from controllers.safety.faults import Fault
from geometry.arrays import Array
from sim.compilation.bound_call import BoundCall
from sim.compilation.memory_access import items
from sim.devices import hid_protocol as protocol
from sim.devices import hid_reports as reports
from sim.devices.driver import DeviceIdentity, DriverFault, make_telemetry
from sim.devices.exchange import READING_CLOCK, READING_GIMBAL, READING_THETA
from sim.devices.hid_reports import HidMemory, judge_report, make_command
from sim.devices.hidapi_node import Bytes, HidapiNode
from sim.errors import SimError

_MAX_REPORTS_PER_READ = 64  # length of Linux's report queue of a hidraw node
_DEVICE_RESET = float(Fault.DEVICE_RESET)


class HidHandle(Protocol):
    """The methods of `hidraw.device` that are used; on unplug `read` raises OSError, and `write` returns −1."""

    def read(self, max_length: int, timeout_ms: int = 0) -> list[int]: ...  # noqa: D102
    def write(self, buff: bytes) -> int: ...  # noqa: D102
    def get_feature_report(self, report_num: int, max_length: int) -> list[int]: ...  # noqa: D102
    def send_feature_report(self, buff: bytes) -> int: ...  # noqa: D102
    def set_nonblocking(self, value: bool) -> int: ...  # noqa: D102
    def close(self) -> None: ...  # noqa: D102


class HidPhantom:
    """The driver of a Phantom behind a HID handle (see `sim.devices.driver.Driver`).

    Parameters
    ----------
    handle : HidHandle or HidapiNode
        Open; owned from here on.
    transport : str
        Name of the transport for messages, such as ``/dev/hidraw3``.
    clock : callable
        Host clock for round trip, jitter and staleness [s]; readings are timestamped by the device's own clock.

    Raises
    ------
    SimError
        If the device does not answer by the protocol, or its calibration has a scale of 0.
    DriverFault
        If it speaks another major version of the protocol, or is gone.
    """

    def __init__(self, handle: HidHandle | HidapiNode, transport: str, clock: Callable[[], float] = time.perf_counter):
        self._handle, self._clock = handle, clock
        self._transport = transport
        handle.set_nonblocking(True)
        self.telemetry = make_telemetry()
        self._hid = HidMemory.fresh(self.telemetry)
        self._read_identity()
        self._read_calibration()
        self._io, self._reading, self._zero_torque = items(self._hid.io), items(self._hid.reading), np.zeros(3)
        self._judge, self._make_command = BoundCall(judge_report, (self._hid,)), BoundCall(make_command, (self._hid,))
        self._receive, self._send = _make_transfers(handle, self._hid.received, self._hid.sent)

    def _read_feature(self, number: int) -> Any:
        try:
            return protocol.decode_report(bytes(self._handle.get_feature_report(number, protocol.REPORT_SIZE)), number)
        except OSError:
            raise DriverFault(Fault.UNPLUGGED) from None

    def _read_identity(self) -> None:
        identity = self._read_feature(protocol.IDENTITY)
        if int(identity["magic"]) != protocol.MAGIC:
            raise SimError(
                f"{self._transport} answers with the magic {int(identity['magic']):#x}; expected {protocol.MAGIC:#x}"
            )
        if int(identity["major"]) != protocol.VERSION[0]:
            raise DriverFault(Fault.VERSION_WRONG, int(identity["major"]))
        self._identity_report, numbers = identity, self._hid.numbers
        numbers[reports.N_BOOT] = int(identity["boot"])
        numbers[reports.N_WATCHDOG] = min(round(reports.WATCHDOG_TIME * 1e6), int(identity["watchdog_max_us"]))
        self._hid.peak[:] = identity["peak_torque"] * protocol.PEAK_UNIT
        self._capabilities = int(identity["capabilities"])

    def _read_calibration(self) -> None:
        found = self._read_feature(protocol.CALIBRATION)
        counts, turns = found["counts_per_turn"] * protocol.COUNT_UNIT, found["motor_turns"] * protocol.TURN_UNIT
        if not (np.all(counts) and np.all(turns > 0.0)):
            raise SimError(
                f"{self._transport}: the calibration has counts a turn {counts.tolist()} and motor turns "
                f"{turns.tolist()}; expected none to be 0"
            )
        self._hid.zero[:], self._hid.angle[:], self._hid.turns[:] = found["zero"], 2.0 * np.pi / counts, turns
        identity = self._identity_report
        motors, watchdog = (bool(self._capabilities & flag) for flag in (protocol.HAS_MOTORS, protocol.HAS_WATCHDOG))
        self.identity = DeviceIdentity(
            identity["name"].decode(errors="replace"), self._transport, identity["serial"].decode(errors="replace"),
            identity["firmware"].decode(errors="replace"), motors and bool(np.all(self._hid.peak > 0.0)),
            watchdog and int(self._hid.numbers[reports.N_WATCHDOG]) > 0, bool(found["flags"] & protocol.CALIBRATED),
            int(self._hid.numbers[reports.N_BOOT]),
        )  # fmt: skip

    def calibrate(self, theta: Array, gimbal: Array) -> None:
        """Set the encoder zeros in the device, given its present joint angles [rad], shape (3,) each.

        The motors are switched off first.

        Raises
        ------
        SimError
            If no reading came within a tenth of a second, a zero does not fit into 32 bits, or the device did not store
            the calibration.
        """
        self.let_go()
        reading = np.zeros(READING_GIMBAL + 3)
        if not self.read(reading, 0.1):
            raise SimError(f"{self._transport}: no reading came within 0.1 s, so there is nothing to calibrate")
        counts = self._hid.zero + reading[READING_THETA:] / self._hid.angle
        calibration = protocol.empty_report(protocol.CALIBRATION)
        calibration["flags"] = protocol.CALIBRATED
        zero = np.rint(counts - np.concatenate([theta, gimbal]) / self._hid.angle)
        if not np.all(np.abs(zero) < 2**31):  # false for NaN too
            raise SimError(
                f"{self._transport}: a zero at {zero.tolist()} counts cannot be kept; expected numbers of 32 bits"
            )
        calibration["zero"] = zero
        calibration["counts_per_turn"] = np.rint(2.0 * np.pi / self._hid.angle / protocol.COUNT_UNIT)
        calibration["motor_turns"] = np.rint(self._hid.turns / protocol.TURN_UNIT)
        self._handle.send_feature_report(protocol.encode_report(calibration))
        self._read_calibration()
        if not np.array_equal(self._hid.zero, calibration["zero"]):
            raise SimError(f"{self._transport} did not keep the calibration; expected its motors to be off")

    def read(self, reading: Array, timeout: float) -> bool:
        """See `sim.devices.driver.Driver.read`; readings are timestamped by the device's time since its power-up."""
        io, report_count, has_new = self._io, 0, False
        try:
            size = self._receive(math.ceil(timeout * 1e3))
            while size > 0:
                io[reports.IO_SIZE], io[reports.IO_NOW] = size, self._clock()
                self._judge()
                if io[reports.IO_FAULT] != 0.0:
                    self._raise_report_fault()
                has_new, report_count = io[reports.IO_NEW] > 0.0 or has_new, report_count + 1
                size = self._receive(0) if report_count < _MAX_REPORTS_PER_READ else 0
        except OSError:
            raise DriverFault(Fault.UNPLUGGED) from None
        if has_new:
            np.copyto(reading, self._hid.reading)
            io[reports.IO_READING_TIME] = self._reading[READING_CLOCK]
        return has_new

    def _raise_report_fault(self) -> None:
        """Raise the fault of a report; after a reset of the device, its identity is read again first."""
        if self._io[reports.IO_FAULT] == _DEVICE_RESET:
            self._reread_after_reset()
        raise DriverFault(Fault(int(self._io[reports.IO_FAULT])), self._io[reports.IO_VALUE])

    def _reread_after_reset(self) -> None:
        """Read identity and calibration again after a reset of the device, in which it may have lost its zero.

        A device that still has its zero may be cleared and armed again; for any other the old boot number is kept, so
        that the fault recurs until the device is closed.
        """
        numbers = self._hid.numbers
        old_boot = int(numbers[reports.N_BOOT])
        numbers[[reports.N_LAST, reports.N_ENABLED]] = -1
        self._hid.clocks[0] = math.nan  # the device's clock has restarted
        try:
            self._read_identity()
            self._read_calibration()
        except DriverFault:
            raise
        except SimError:  # no valid answer
            numbers[reports.N_BOOT] = old_boot
        if not self.identity.calibrated:
            numbers[reports.N_BOOT] = old_boot

    def write(self, torque: Array, enable: bool) -> None:
        """See `sim.devices.driver.Driver.write`; torques are limited to the peak torque that the device reports.

        Raises
        ------
        DriverFault
            If the device is gone, or a torque is not finite; the motors are then switched off.
        """
        io = self._io
        np.copyto(self._hid.torque, torque)
        io[reports.IO_ENABLE], io[reports.IO_NOW] = enable, self._clock()
        self._make_command()
        if io[reports.IO_FAULT] != 0.0:
            value = io[reports.IO_VALUE]
            self.let_go()
            raise DriverFault(Fault.FORCE_NOT_FINITE, value)
        try:
            written = self._send()
        except (OSError, ValueError):  # hidapi's binding raises ValueError once it is closed
            written = -1
        if written < 0:
            raise DriverFault(Fault.UNPLUGGED)

    def let_go(self) -> None:
        """Switch the motors off at once; never raises."""
        with contextlib.suppress(DriverFault):
            self.write(self._zero_torque, False)

    def close(self) -> None:
        """Switch the motors off and close the device."""
        self.let_go()
        self._handle.close()


def _make_transfers(
    handle: HidHandle | HidapiNode, incoming: Bytes, outgoing: Bytes
) -> tuple[Callable[[int], int], Callable[[], int]]:
    """Functions that receive a report into `incoming` within a timeout [ms], and that send `outgoing`."""
    if isinstance(handle, HidapiNode):
        return handle.transfers(incoming, outgoing)

    def receive(timeout_ms: int) -> int:
        raw = handle.read(len(incoming), timeout_ms)
        incoming[: len(raw)] = raw
        return len(raw)

    def send() -> int:
        return handle.write(outgoing.tobytes())

    return receive, send
