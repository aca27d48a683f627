"""Packets of numbers through a local socket, by libc's own calls from compiled code: nothing is taken from the heap.

Linux's `ppoll` and errno; `socket.SOCK_SEQPACKET` between processes is Linux's as well.
"""

import errno
import socket

from numba import njit, types

from controllers.state import Array
from controllers.work_array import work_integers
from sim.compilation.memory_access import int32_at

_receive = types.ExternalFunction("recv", types.int64(types.int32, types.intp, types.uint64, types.int32))
_transmit = types.ExternalFunction("send", types.int64(types.int32, types.intp, types.uint64, types.int32))
_ppoll = types.ExternalFunction("ppoll", types.int32(types.intp, types.uint64, types.intp, types.intp))
_clock_gettime = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.intp))
_errno_place = types.ExternalFunction("__errno_location", types.intp())

_NOW, _AGAIN = int(socket.MSG_DONTWAIT), int(errno.EAGAIN)
_READABLE = 1 << 32  # POLLIN in `struct pollfd`, after the descriptor
_CLOCK_MONOTONIC = 1
NOTHING = -1
"""No packet is there, or no room for one."""
BROKEN = 0
"""Nobody is at the other end."""


@njit
def monotonic() -> float:
    """`time.monotonic` [s]."""
    time = work_integers(2)
    _clock_gettime(_CLOCK_MONOTONIC, time.ctypes.data)
    return time[0] + 1e-9 * time[1]


@njit
def receive(descriptor: int, packet: Array) -> int:
    """Take the next packet; its size in bytes, or `NOTHING`, or `BROKEN`."""
    size = _receive(descriptor, packet.ctypes.data, 8 * len(packet), _NOW)
    if size >= 0:
        return size
    return NOTHING if int32_at(_errno_place()) == _AGAIN else BROKEN


@njit
def transmit(descriptor: int, packet: Array) -> int:
    """Send a packet; its size in bytes, or `NOTHING`, or `BROKEN`."""
    size = _transmit(descriptor, packet.ctypes.data, 8 * len(packet), _NOW)
    if size >= 0:
        return size
    return NOTHING if int32_at(_errno_place()) == _AGAIN else BROKEN


@njit
def wait_for_packet(descriptor: int, seconds: float) -> None:
    """Wait until there is a packet, or until a time of less than a second has passed [s]."""
    polled, time = work_integers(1), work_integers(2)
    polled[0], time[0], time[1] = descriptor + _READABLE, 0, int(seconds * 1e9)
    _ppoll(polled.ctypes.data, 1, time.ctypes.data, 0)
