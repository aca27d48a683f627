"""The emulated Phantom in a process of its own, reached by packets, with a watchdog that survives the servo's death.

Packets carry eight-byte numbers: one whole reading with the time at which it was sent, or one command, as reports of
USB HID do. Each command advances the device by a servo period and is answered by a reading. If no command comes for the
watchdog's time, the device is advanced by that time under the last command; then its motors are switched off, and it
continues to run without commands.
"""

import errno
import os
import select
import signal
import socket
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit, types

from controllers.safety.faults import Fault
from controllers.work_array import work_integers
from geometry.arrays import Array
from sim.compilation.bound_call import BoundCall
from sim.compilation.compiled import entry_point
from sim.compilation.memory_access import int32_at, items
from sim.devices.driver import LOST, READ, ROUND_TRIP, DriverFault, make_telemetry, note_arrival
from sim.devices.exchange import READING_SEQUENCE, READING_SIZE
from sim.hardware.emulated import EmulatedPhantom, emulated_identity
from sim.hardware.process_start import parent_id
from sim.hardware.realtime import become_realtime
from sim.hardware.shared import SharedNumbers

WATCHDOG_TIME = 0.02
"""Time without a command after which the device switches its motors off [s]: twenty periods at 1 kHz."""
_MOTORS_OFF_COMMAND = bytes(32)  # a command of zero torques with the motors off
_SENDING_TIME, _PACKET_SIZE = READING_SIZE, READING_SIZE + 1  # in a reading's packet: index of the sending time; size
SHOWN_TORQUE, SHOWN_TRIPS, SHOWN_CLOCK, SHOWN_SIZE = 0, 3, 4, 5
"""Places in the device's published status: motor torques (3) [N m], number of times its watchdog tripped, its clock
[s]."""
_receive = types.ExternalFunction("recv", types.int64(types.int32, types.intp, types.uint64, types.int32))
_transmit = types.ExternalFunction("send", types.int64(types.int32, types.intp, types.uint64, types.int32))
_ppoll = types.ExternalFunction("ppoll", types.int32(types.intp, types.uint64, types.intp, types.intp))
_clock_gettime = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.intp))
_errno_location = types.ExternalFunction("__errno_location", types.intp())

_MSG_DONTWAIT, _EAGAIN = int(socket.MSG_DONTWAIT), int(errno.EAGAIN)
_POLLIN = 1 << 32  # POLLIN in `struct pollfd`, after the descriptor
_CLOCK_MONOTONIC = 1
NOTHING = -1
"""Result: there is no packet to receive, or no room to send one."""
CLOSED = 0
"""Result: the other end is closed."""


@njit
def monotonic() -> float:
    """`time.monotonic` [s]."""
    time = work_integers(2)
    _clock_gettime(_CLOCK_MONOTONIC, time.ctypes.data)
    return time[0] + 1e-9 * time[1]


@njit
def receive(descriptor: int, packet: Array) -> int:
    """Receive the next packet without waiting; returns its size in bytes, `NOTHING` or `CLOSED`."""
    size = _receive(descriptor, packet.ctypes.data, 8 * len(packet), _MSG_DONTWAIT)
    if size >= 0:
        return size
    return NOTHING if int32_at(_errno_location()) == _EAGAIN else CLOSED


@njit
def transmit(descriptor: int, packet: Array) -> int:
    """Send a packet without waiting; returns its size in bytes, `NOTHING` or `CLOSED`."""
    size = _transmit(descriptor, packet.ctypes.data, 8 * len(packet), _MSG_DONTWAIT)
    if size >= 0:
        return size
    return NOTHING if int32_at(_errno_location()) == _EAGAIN else CLOSED


@njit
def wait_for_packet(descriptor: int, seconds: float) -> None:
    """Wait until there is a packet, at most for a time of less than a second [s]."""
    polled, time = work_integers(1), work_integers(2)
    polled[0], time[0], time[1] = descriptor + _POLLIN, 0, int(seconds * 1e9)
    _ppoll(polled.ctypes.data, 1, time.ctypes.data, 0)


class EmulatedEnd(NamedTuple):
    """The device's end of the connection: its socket, its published status, and its servo period [s]."""

    packets: socket.socket
    shown: SharedNumbers
    period: float


def host_device(make: Callable[[], EmulatedPhantom], end: EmulatedEnd, realtime: bool) -> None:
    """Run the device until the parent process has ended; the target of a process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    device, parent = make(), parent_id()
    device.write(np.zeros(3), False)
    if realtime:
        become_realtime()
    packet, shown, trip_count, is_silent = np.zeros(_PACKET_SIZE), np.zeros(SHOWN_SIZE), 0, True
    no_torque, last_command = np.zeros(3), np.zeros(4)
    while os.getppid() == parent:
        command = _receive_command(end.packets, end.period if is_silent else WATCHDOG_TIME)
        if command is None:
            if not is_silent:
                trip_count += 1
                for _ in range(round(WATCHDOG_TIME / end.period)):
                    device.write(last_command[:3], last_command[3] > 0.0)
            is_silent = True
            device.write(no_torque, False)
        else:
            is_silent, last_command = False, command
            device.write(command[:3], command[3] > 0.0)
        device.read(packet[:READING_SIZE], 0.0)
        shown[SHOWN_TORQUE : SHOWN_TORQUE + 3] = device.torque
        shown[SHOWN_TRIPS], shown[SHOWN_CLOCK] = trip_count, device.clock
        end.shown.write(shown)
        packet[_SENDING_TIME] = time.monotonic()
        try:
            end.packets.send(packet.data, socket.MSG_DONTWAIT)
        except OSError:
            if command is None:
                time.sleep(end.period)  # the servo takes no readings, or is gone


def _receive_command(packets: socket.socket, timeout: float) -> Array | None:
    """The next command; None if there was none within the timeout [s]."""
    if not select.select([packets], [], [], timeout)[0]:
        return None
    try:
        packet = packets.recv(64)
    except OSError:
        return None
    return np.frombuffer(packet) if len(packet) == 32 else None


class Link(NamedTuple):
    """The servo's end of the connection, for compiled code.

    Attributes
    ----------
    descriptor : int
        File descriptor of the socket.
    packet, reading : Array
        The last packet received, with room for one number more, and the last reading, of `READING_SIZE`.
    command : Array
        Torques [N m], and 1 if the motors are to be on, shape (4,).
    telemetry, clocks : Array
        Those of `sim.devices.driver.note_arrival`.
    io : Array
        Arguments and results of the kernels, see `IO_NEW`.
    """

    descriptor: int
    packet: Array
    reading: Array
    command: Array
    telemetry: Array
    clocks: Array
    io: Array


IO_NEW, IO_SIZE, IO_SEND_RESULT, IO_SENT, IO_SEQUENCE, IO_WAIT, IO_LENGTH = range(7)
"""Places in `Link.io`: number of readings taken; size of a malformed packet, or `NOTHING` or `CLOSED`; result of
sending the last command, and when it was sent [s]; number of the last reading; timeout of a reading [s]."""


@entry_point
def take_readings(link: Link) -> None:
    """Take all readings that have arrived or, if there are none, wait for the next ones within the timeout."""
    io, telemetry = link.io, link.telemetry
    io[IO_NEW], io[IO_SIZE] = 0.0, NOTHING
    waited = False
    while True:
        size = receive(link.descriptor, link.packet)
        if size == NOTHING and not waited and io[IO_NEW] == 0.0:
            wait_for_packet(link.descriptor, io[IO_WAIT])
            waited = True
            continue
        if size != 8 * _PACKET_SIZE:
            io[IO_SIZE] = size
            break
        for i in range(READING_SIZE):
            link.reading[i] = link.packet[i]
        io[IO_NEW] += 1.0
    if io[IO_NEW] == 0.0:
        return
    number, now = link.reading[READING_SEQUENCE], monotonic()
    telemetry[ROUND_TRIP] = now - io[IO_SENT]
    telemetry[READ] += 1
    telemetry[LOST] += max(0.0, number - io[IO_SEQUENCE] - 1.0) if io[IO_SEQUENCE] > 0.0 else 0.0
    note_arrival(telemetry, link.clocks, now, link.packet[_SENDING_TIME])
    io[IO_SEQUENCE] = number


@entry_point
def send_command(link: Link) -> None:
    """Send the command, and store the time."""
    link.io[IO_SENT] = monotonic()
    link.io[IO_SEND_RESULT] = transmit(link.descriptor, link.command)


class EmulatedDriver:
    """Driver of an emulated Phantom in another process.

    Parameters
    ----------
    packets : socket.socket
        The socket connected to that of `EmulatedEnd`.
    calibrated : bool
        Whether the zero of its encoders is known.
    """

    def __init__(self, packets: socket.socket, calibrated: bool = True):
        packets.setblocking(False)
        self._packets, self.telemetry, io = packets, make_telemetry(), np.zeros(IO_LENGTH)
        self._reading, self._command = np.zeros(READING_SIZE), np.zeros(4)
        link = Link(
            packets.fileno(), np.zeros(_PACKET_SIZE + 1), self._reading, self._command, self.telemetry,
            np.full(3, np.nan), io,
        )  # fmt: skip
        io[IO_SENT] = time.monotonic()
        self._torque, self._io = self._command[:3], items(io)
        self._take_readings, self._send_command = BoundCall(take_readings, (link,)), BoundCall(send_command, (link,))
        self.identity = emulated_identity("MuJoCo in another process", calibrated)

    def read(self, reading: Array, timeout: float) -> bool:
        """As `sim.devices.driver.Driver`."""
        io = self._io
        io[IO_WAIT] = timeout
        self._take_readings()
        if io[IO_SIZE] == CLOSED:
            raise DriverFault(Fault.UNPLUGGED)
        if io[IO_SIZE] != NOTHING:
            raise DriverFault(Fault.REPORT_MALFORMED, io[IO_SIZE])
        np.copyto(reading, self._reading)
        return io[IO_NEW] > 0.0

    def write(self, torque: Array, enable: bool) -> None:
        """As `sim.devices.driver.Driver`."""
        np.copyto(self._torque, torque)
        self._command[3] = enable
        self._send_command()
        if self._io[IO_SEND_RESULT] == CLOSED:
            raise DriverFault(Fault.UNPLUGGED)
        # If there was no room for the packet, the device is too slow; its readings will then become stale.

    def let_go(self) -> None:
        """As `sim.devices.driver.Driver`."""
        try:
            self._packets.send(_MOTORS_OFF_COMMAND)
        except OSError:
            return

    def close(self) -> None:
        """As `sim.devices.driver.Driver`."""
        self.let_go()
        self._packets.close()
