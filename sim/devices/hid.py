r"""A Phantom that speaks the open HID protocol (`docs/reference/hid-protocol.md`), through hidapi.

Angles and torques of the joints come from the device's own calibration:

.. math:: \theta_i = 2\pi\,(n_i - z_i)/N_i, \qquad \tau_{motor,i} = \tau_i/\eta_i

n the counts, z their zero, N counts a turn of the joint, η motor turns a turn of the joint.
"""

import contextlib
import math
import time
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from controllers.safety.faults import Fault, first_not_finite
from controllers.state import Array
from sim.devices import hid_protocol as protocol
from sim.devices.driver import (
    BAD,
    LOST,
    READ,
    ROUND_TRIP,
    TEMPERATURE,
    Arrivals,
    DeviceIdentity,
    DriverFault,
    fresh_telemetry,
)
from sim.devices.exchange import (
    READING_CLOCK,
    READING_GIMBAL,
    READING_SEQUENCE,
    READING_SWITCH,
    READING_THETA,
)
from sim.errors import SimError

WATCHDOG = 0.01
"""Time without a command after which the firmware switches the motors off [s]: twice the silence after which a command
is no longer valid here, so that it acts when this process no longer can, and not before."""
HOTTEST = 100.0
"""Motor temperature that is a fault [°C]: 25 below what Maxon allows an RE 25's winding."""
_BAD_IN_ROW = 3  # a disturbance spoils one report or two; a cable or a device that is broken goes on
_DRAIN = 64  # reports that Linux keeps for a hidraw node
_SENT = 256  # commands whose time is kept, for the round trip
_CELSIUS = protocol.TEMPERATURE_UNIT
_ERRORS = protocol.STATUS_AMPLIFIER | protocol.STATUS_ENCODER


class HidHandle(Protocol):
    """What is used of `hidraw.device`: on unplug `read` raises OSError, and `write` returns −1."""

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
    handle : HidHandle
        Open; owned from here on.
    transport : str
        For people, such as ``/dev/hidraw3``.
    clock : callable
        Seconds, for round trip, jitter and staleness; readings carry the device's own clock.

    Raises
    ------
    SimError
        If the device does not answer as the protocol has it, or its calibration has no scale.
    DriverFault
        If it speaks another major version, or is gone.
    """

    def __init__(self, handle: HidHandle, transport: str, clock: Callable[[], float] = time.perf_counter):
        self._handle, self._clock = handle, clock
        self._transport = transport
        handle.set_nonblocking(True)
        self._take_identity()
        self.telemetry = fresh_telemetry()
        self._arrivals = Arrivals(self.telemetry)
        self._take_calibration()
        self._last: int | None = None  # number of the last input report
        self._taken = self._bad = 0
        self._sent, self._sent_at = 0, np.full(_SENT, np.nan)
        self._enabled_since: int | None = None  # number of the output report that switched the motors on
        self._again = False  # the motors went off while nobody was there: switch off, then on
        self._given = math.nan  # device's time of the reading that was handed out last

    def _feature(self, number: int) -> Any:
        try:
            return protocol.unsealed(bytes(self._handle.get_feature_report(number, protocol.REPORT_SIZE)), number)
        except OSError:
            raise DriverFault(Fault.UNPLUGGED) from None

    def _take_identity(self) -> None:
        who = self._feature(protocol.IDENTITY)
        if int(who["magic"]) != protocol.MAGIC:
            raise SimError(
                f"{self._transport} answers with the mark {int(who['magic']):#x}; expected {protocol.MAGIC:#x}"
            )
        if int(who["major"]) != protocol.VERSION[0]:
            raise DriverFault(Fault.VERSION_WRONG, int(who["major"]) + int(who["minor"]) / 10)
        self._who, self._boot = who, int(who["boot"])
        self._peak: Array = who["peak_torque"] * protocol.PEAK_UNIT
        self._watchdog_us = min(round(WATCHDOG * 1e6), int(who["watchdog_max_us"]))
        self._capabilities = int(who["capabilities"])

    def _take_calibration(self) -> None:
        found = self._feature(protocol.CALIBRATION)
        counts, turns = found["counts_per_turn"] * protocol.COUNT_UNIT, found["motor_turns"] * protocol.TURN_UNIT
        if not (np.all(counts) and np.all(turns > 0.0)):
            raise SimError(
                f"{self._transport}: the calibration has counts a turn {counts.tolist()} and motor turns "
                f"{turns.tolist()}; expected none to be 0"
            )
        self._zero: Array = found["zero"].astype(np.float64)
        self._angle: Array = 2.0 * np.pi / counts
        self._turns: Array = turns
        who = self._who
        self.identity = DeviceIdentity(
            who["name"].decode(errors="replace"), self._transport, who["serial"].decode(errors="replace"),
            who["firmware"].decode(errors="replace"), bool(self._capabilities & protocol.HAS_MOTORS),
            bool(self._capabilities & protocol.HAS_WATCHDOG), bool(found["flags"] & protocol.CALIBRATED),
            self._boot,
        )  # fmt: skip

    def calibrate(self, theta: Array, gimbal: Array) -> None:
        """Store in the device that its joints are at these angles now [rad], shape (3,) each; motors off before.

        Raises
        ------
        SimError
            If no reading came within a tenth of a second, or the device did not keep it.
        """
        self.let_go()
        reading = np.zeros(READING_GIMBAL + 3)
        if not self.read(reading, 0.1):
            raise SimError(f"{self._transport}: no reading came within 0.1 s, so there is nothing to calibrate")
        counts = self._zero + reading[READING_THETA:] / self._angle
        wanted = protocol.blank(protocol.CALIBRATION)
        wanted["flags"] = protocol.CALIBRATED
        wanted["zero"] = np.rint(counts - np.concatenate([theta, gimbal]) / self._angle)
        wanted["counts_per_turn"] = np.rint(2.0 * np.pi / self._angle / protocol.COUNT_UNIT)
        wanted["motor_turns"] = np.rint(self._turns / protocol.TURN_UNIT)
        self._handle.send_feature_report(protocol.sealed(wanted))
        self._take_calibration()
        if not np.array_equal(self._zero, wanted["zero"]):
            raise SimError(f"{self._transport} did not keep the calibration; expected its motors to be off")

    def read(self, reading: Array, timeout: float) -> bool:
        """See `sim.devices.driver.Driver.read`; readings carry the device's time since its power-up."""
        new, taken = False, 0
        try:
            # A byte of room shows a report that is too long.
            raw = self._handle.read(protocol.REPORT_SIZE + 1, math.ceil(timeout * 1e3))
            while raw:
                new = self._take(bytes(raw), reading) or new
                taken += 1
                raw = self._handle.read(protocol.REPORT_SIZE + 1) if taken < _DRAIN else []
        except OSError:
            raise DriverFault(Fault.UNPLUGGED) from None
        if new:
            self._given = float(reading[READING_CLOCK])
        return new

    def _take(self, raw: bytes, reading: Array) -> bool:
        """Judge one input report, and write the reading that it has; whether it is a new one."""
        if len(raw) != protocol.REPORT_SIZE or raw[0] != protocol.INPUT:
            self.telemetry[BAD] += 1.0
            raise DriverFault(Fault.REPORT_MALFORMED, len(raw))
        if not protocol.is_sound(raw):
            self.telemetry[BAD] += 1.0
            self._bad += 1
            if self._bad >= _BAD_IN_ROW:
                raise DriverFault(Fault.CHECKSUM_WRONG, self._bad)
            return False
        self._bad = 0
        report = protocol.unpacked_input(raw)
        self._judge_boot(report.boot)
        if self._last is None:
            self._take_over(report)
        if not self._is_next(report.sequence):
            return False
        reading[READING_THETA : READING_GIMBAL + 3] = (report.encoder - self._zero) * self._angle
        reading[READING_SWITCH] = report.flags & protocol.SWITCH
        reading[READING_CLOCK] = report.time_us * 1e-6
        self._taken += 1
        reading[READING_SEQUENCE] = self._taken
        self._measure(report)
        self._judge_status(report.status)
        self._judge_watchdog(report)
        return True

    def _take_over(self, report: protocol.InputReport) -> None:
        """Go on where another program stopped: with its numbers, and with motors that its silence switched off."""
        if not 0 <= report.answered <= self._sent:
            self._sent = report.answered
        self._again = bool(report.status & protocol.STATUS_WATCHDOG)

    def _judge_boot(self, boot: int) -> None:
        """A device that began again is asked anew who it is: with its zero it has lost what it was armed by.

        One that still knows its zero may be cleared and armed; any other stays a fault for as long as it is open.
        """
        before = self._boot
        if boot == before:
            return
        self._last = self._enabled_since = None
        self._arrivals.again()
        try:
            self._take_identity()
            self._take_calibration()
        except DriverFault:
            raise
        except SimError:  # no sound answer
            self._boot = before
        if not self.identity.calibrated:
            self._boot = before
        raise DriverFault(Fault.DEVICE_RESET)

    def _is_next(self, number: int) -> bool:
        """Whether a report's number is ahead of the last one's; the same one again is refused, an older one a fault."""
        ahead = 1 if self._last is None else (number - self._last + 2**31) % 2**32 - 2**31
        if ahead <= 0:
            self.telemetry[BAD] += 1.0
            if ahead < 0:
                raise DriverFault(Fault.SEQUENCE_BACK, -ahead)
            return False
        self.telemetry[LOST] += ahead - 1.0
        self.telemetry[READ] += 1.0
        self._last = number
        return True

    def _measure(self, report: protocol.InputReport) -> None:
        now, told = self._clock(), self.telemetry
        for i, celsius in enumerate(report.temperature):
            told[TEMPERATURE + i] = math.nan if celsius == protocol.NO_TEMPERATURE else celsius * _CELSIUS
        if 0 <= self._sent - report.answered < _SENT and report.answered > 0:
            told[ROUND_TRIP] = now - self._sent_at[report.answered % _SENT] - report.held_us * 1e-6
        self._arrivals.note(now, report.time_us * 1e-6)

    def _judge_status(self, status: int) -> None:
        hottest = -math.inf
        for celsius in self.telemetry[TEMPERATURE : TEMPERATURE + 3].tolist():
            hottest = max(hottest, celsius)  # what is not a number is left out
        if status & protocol.STATUS_HOT or hottest >= HOTTEST:
            raise DriverFault(Fault.OVER_TEMPERATURE, hottest)
        told = status & _ERRORS
        if told:
            raise DriverFault(Fault.DEVICE_REPORTED, told)

    def _judge_watchdog(self, report: protocol.InputReport) -> None:
        """The firmware switched off: a fault where commands went out and did not arrive, and else a gap.

        After a gap the force is ramped in again by who drives, so the motors may be switched on again.
        """
        since = self._enabled_since
        if since is None or not report.status & protocol.STATUS_WATCHDOG or report.answered < since:
            return
        if report.time_us * 1e-6 - self._given > 0.5 * WATCHDOG:
            self._again = True
        else:
            raise DriverFault(Fault.DEVICE_REPORTED, protocol.STATUS_WATCHDOG)

    def write(self, torque: Array, enable: bool) -> None:
        """See `sim.devices.driver.Driver.write`; a torque is cut at the peak torque that the device tells.

        Raises
        ------
        DriverFault
            If the device is gone, or a torque is not finite: then the motors are off.
        """
        if not np.isfinite(torque).all():
            self.let_go()
            raise DriverFault(Fault.FORCE_NOT_FINITE, first_not_finite(torque))
        self._sent += 1
        enable, self._again = enable and not self._again, False
        if not enable:
            self._enabled_since = None
        elif self._enabled_since is None:
            self._enabled_since = self._sent
        shaft = np.clip(torque / self._turns, -self._peak, self._peak) / protocol.TORQUE_UNIT if enable else np.zeros(3)
        report = protocol.packed_output(
            enable, self._boot, self._sent % 2**32, self._watchdog_us, np.rint(shaft).astype(int).tolist(),
            self._last or 0,
        )  # fmt: skip
        self._sent_at[self._sent % _SENT] = self._clock()
        try:
            written = self._handle.write(report)
        except (OSError, ValueError):  # hidapi's binding raises ValueError once it is closed
            written = -1
        if written < 0:
            raise DriverFault(Fault.UNPLUGGED)

    def let_go(self) -> None:
        """Motors off, at once; never raises."""
        with contextlib.suppress(DriverFault):
            self.write(np.zeros(3), False)

    def close(self) -> None:
        """Let go, and give the device back."""
        self.let_go()
        self._handle.close()
