"""The emulated Phantom in a process of its own, behind packets, with a watchdog: what the servo's end cannot spare it.

Packets carry eight-byte numbers, one whole reading or command each, as reports of USB HID do. Each command lets a servo
period pass in the device, and is answered by a reading. When none comes for the watchdog's time, that time passes in
the device under the last command, then its motors go off, and its time goes on by itself.
"""

import os
import select
import signal
import socket
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from controllers.safety.faults import Fault
from controllers.state import Array
from sim.devices.driver import LOST, READ, ROUND_TRIP, TELEMETRY_SIZE, TEMPERATURE, DriverFault
from sim.devices.exchange import READING_SEQUENCE, READING_SIZE
from sim.hardware.emulated import EmulatedPhantom, emulated_identity
from sim.hardware.realtime import become_realtime
from sim.hardware.shared import SharedNumbers

WATCHDOG = 0.02
"""Time without a command after which the device lets go [s]: twenty periods at 1 kHz."""
SHOWN_TORQUE, SHOWN_TRIPS, SHOWN_CLOCK, SHOWN_SIZE = 0, 3, 4, 5
"""What a bystander sees of the device: torques of its motors [N m], how often its watchdog let go, its clock [s]."""


class EmulatedEnd(NamedTuple):
    """The device's end: its socket, what bystanders see of it, and its servo period [s]."""

    packets: socket.socket
    shown: SharedNumbers
    period: float


def host_device(make: Callable[[], EmulatedPhantom], end: EmulatedEnd, realtime: bool) -> None:
    """Be the device, until the process that started this one is gone; the target of a process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    device, parent = make(), os.getppid()
    device.write(np.zeros(3), False)
    if realtime:
        become_realtime()
    reading, shown, trips, quiet = np.zeros(READING_SIZE), np.zeros(SHOWN_SIZE), 0, True
    off, last = np.zeros(3), np.zeros(4)
    while os.getppid() == parent:
        command = _command(end.packets, end.period if quiet else WATCHDOG)
        if command is None:
            if not quiet:
                trips += 1
                for _ in range(round(WATCHDOG / end.period)):
                    device.write(last[:3], last[3] > 0.0)
            quiet = True
            device.write(off, False)
        else:
            quiet, last = False, command
            device.write(command[:3], command[3] > 0.0)
        device.read(reading, 0.0)
        shown[SHOWN_TORQUE : SHOWN_TORQUE + 3] = device.torque
        shown[SHOWN_TRIPS], shown[SHOWN_CLOCK] = trips, device.clock
        end.shown.write(shown)
        try:
            end.packets.send(reading.tobytes(), socket.MSG_DONTWAIT)
        except OSError:
            if command is None:
                time.sleep(end.period)  # nobody takes its readings, or is there


def _command(packets: socket.socket, timeout: float) -> Array | None:
    """The next command; None if there was none in time [s]."""
    if not select.select([packets], [], [], timeout)[0]:
        return None
    try:
        packet = packets.recv(64)
    except OSError:
        return None
    return np.frombuffer(packet) if len(packet) == 32 else None


class EmulatedDriver:
    """Driver of an emulated Phantom in another process.

    Parameters
    ----------
    packets : socket.socket
        The other end of `EmulatedEnd`.
    calibrated : bool
        Whether its encoders know their zero.
    """

    def __init__(self, packets: socket.socket, calibrated: bool = True):
        packets.setblocking(False)
        self._packets, self._sent, self._sequence = packets, time.monotonic(), 0.0
        self._command = np.zeros(4)
        self.telemetry = np.zeros(TELEMETRY_SIZE)
        self.telemetry[TEMPERATURE : TEMPERATURE + 3] = np.nan
        self.identity = emulated_identity("MuJoCo in another process", calibrated)

    def read(self, reading: Array, timeout: float) -> bool:
        """As `sim.devices.driver.Driver`."""
        packet = self._packet()
        if packet is None and select.select([self._packets], [], [], timeout)[0]:
            packet = self._packet()
        newest = packet
        while packet is not None:
            newest, packet = packet, self._packet()
        if newest is None:
            return False
        reading[:] = np.frombuffer(newest)
        number = float(reading[READING_SEQUENCE])
        self.telemetry[ROUND_TRIP] = time.monotonic() - self._sent
        self.telemetry[READ] += 1
        self.telemetry[LOST] += max(0.0, number - self._sequence - 1.0) if self._sequence else 0.0
        self._sequence = number
        return True

    def _packet(self) -> bytes | None:
        try:
            packet = self._packets.recv(8 * READING_SIZE)
        except BlockingIOError:
            return None
        except OSError:
            packet = b""
        if len(packet) == 0:
            raise DriverFault(Fault.UNPLUGGED)
        if len(packet) != 8 * READING_SIZE:
            raise DriverFault(Fault.REPORT_MALFORMED, len(packet))
        return packet

    def write(self, torque: Array, enable: bool) -> None:
        """As `sim.devices.driver.Driver`."""
        self._command[:3], self._command[3] = torque, float(enable)
        self._sent = time.monotonic()
        try:
            self._packets.send(self._command.tobytes())
        except BlockingIOError:
            pass  # the device does not keep up; its readings will be stale
        except OSError:
            raise DriverFault(Fault.UNPLUGGED) from None

    def let_go(self) -> None:
        """As `sim.devices.driver.Driver`."""
        try:
            self._packets.send(bytes(32))
        except OSError:
            return

    def close(self) -> None:
        """As `sim.devices.driver.Driver`."""
        self.let_go()
        self._packets.close()
