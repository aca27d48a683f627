"""The emulated Phantom in a process of its own, behind packets, with a watchdog: what the servo's end cannot spare it.

Packets carry eight-byte numbers, one whole reading, with the time at which it was sent, or command each, as reports of
USB HID do. Each command lets a servo
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
from sim.devices.driver import LOST, READ, ROUND_TRIP, Arrivals, DriverFault, fresh_telemetry
from sim.devices.exchange import READING_SEQUENCE, READING_SIZE
from sim.hardware.emulated import EmulatedPhantom, emulated_identity
from sim.hardware.realtime import become_realtime
from sim.hardware.shared import SharedNumbers

WATCHDOG = 0.02
"""Time without a command after which the device lets go [s]: twenty periods at 1 kHz."""
_SENT_AT, _PACKET = READING_SIZE, READING_SIZE + 1  # in a reading's packet: when it was sent, and how many numbers
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
    packet, shown, trips, quiet = np.zeros(_PACKET), np.zeros(SHOWN_SIZE), 0, True
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
        device.read(packet[:READING_SIZE], 0.0)
        shown[SHOWN_TORQUE : SHOWN_TORQUE + 3] = device.torque
        shown[SHOWN_TRIPS], shown[SHOWN_CLOCK] = trips, device.clock
        end.shown.write(shown)
        packet[_SENT_AT] = time.monotonic()
        try:
            end.packets.send(packet.data, socket.MSG_DONTWAIT)
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
        self._command, self._packet = np.zeros(4), np.zeros(_PACKET + 1)  # room that shows a packet that is too long
        self.telemetry = fresh_telemetry()
        self._arrivals = Arrivals(self.telemetry)
        self.identity = emulated_identity("MuJoCo in another process", calibrated)

    def read(self, reading: Array, timeout: float) -> bool:
        """As `sim.devices.driver.Driver`."""
        new = self._take(reading)
        if not new and select.select([self._packets], [], [], timeout)[0]:
            new = self._take(reading)
        while new and self._take(reading):
            pass
        if not new:
            return False
        number, now = float(reading[READING_SEQUENCE]), time.monotonic()
        self.telemetry[ROUND_TRIP] = now - self._sent
        self.telemetry[READ] += 1
        self.telemetry[LOST] += max(0.0, number - self._sequence - 1.0) if self._sequence else 0.0
        self._arrivals.note(now, float(self._packet[_SENT_AT]))
        self._sequence = number
        return True

    def _take(self, reading: Array) -> bool:
        """Take the next packet; False if there is none."""
        try:
            size = self._packets.recv_into(self._packet.data)
        except BlockingIOError:
            return False
        except OSError:
            size = 0
        if size == 0:
            raise DriverFault(Fault.UNPLUGGED)
        if size != 8 * _PACKET:
            raise DriverFault(Fault.REPORT_MALFORMED, size)
        reading[:] = self._packet[:READING_SIZE]
        return True

    def write(self, torque: Array, enable: bool) -> None:
        """As `sim.devices.driver.Driver`."""
        self._command[:3], self._command[3] = torque, float(enable)
        self._sent = time.monotonic()
        try:
            self._packets.send(self._command.data)
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
