"""Packets of numbers through a local socket, by libc calls from compiled code, without heap allocation.

For Linux only: `ppoll`, `__errno_location`, and `socket.SOCK_SEQPACKET` between processes.
"""

import errno
import socket

from numba import njit, types

from controllers.work_array import work_integers
from geometry.arrays import Array
from sim.compilation.memory_access import int32_at

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
