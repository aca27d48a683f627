"""A HID node through hidapi's own C functions, which its wheel exports, so that reports are passed without allocation.

The wheel's Python binding allocates a list of 64 numbers for each report read, and bytes for each one written.
"""

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from geometry.arrays import Array, IntArray
from sim.compilation.bound_call import BoundCall
from sim.compilation.c_function import address_of, call_int
from sim.compilation.compiled import entry_point
from sim.compilation.memory_access import items

Bytes = npt.NDArray[np.uint8]
_POINTER, _SIZE_T = ctypes.c_void_p, ctypes.c_size_t
_FUNCTIONS: dict[str, tuple[Any, list[Any]]] = {
    "hid_init": (ctypes.c_int, []),
    "hid_open_path": (_POINTER, [ctypes.c_char_p]),
    "hid_set_nonblocking": (ctypes.c_int, [_POINTER, ctypes.c_int]),
    "hid_get_feature_report": (ctypes.c_int, [_POINTER, ctypes.c_char_p, _SIZE_T]),
    "hid_send_feature_report": (ctypes.c_int, [_POINTER, ctypes.c_char_p, _SIZE_T]),
    "hid_read_timeout": (ctypes.c_int, [_POINTER, _POINTER, _SIZE_T, ctypes.c_int]),
    "hid_write": (ctypes.c_int, [_POINTER, _POINTER, _SIZE_T]),
    "hid_close": (None, [_POINTER]),
}  # hidapi.h


@entry_point
def read_report(places: IntArray, incoming: Bytes, io: Array) -> None:
    """Call hid_read_timeout: `places` are its address and the device handle, `io` (2,) timeout [ms] and result."""
    address, size, timeout = incoming.ctypes.data, np.uint64(incoming.shape[0]), np.int32(io[0])
    io[1] = call_int(places[0], (places[1], address, size, timeout))


@entry_point
def write_report(places: IntArray, outgoing: Bytes, io: Array) -> None:
    """Call hid_write: `places` are its address and the device handle, `io` (1,) its result."""
    io[0] = call_int(places[0], (places[1], outgoing.ctypes.data, np.uint64(outgoing.shape[0])))


class HidapiNode:
    """An open HID node; like `sim.devices.hid.HidHandle`, but `transfers` takes the place of `read` and `write`.

    Parameters
    ----------
    library : ctypes.CDLL
        Library with hidapi's functions.
    path : str
        Path of the node.

    Raises
    ------
    OSError
        If the node cannot be opened.
    AttributeError
        If the library lacks one of the functions.
    """

    def __init__(self, library: ctypes.CDLL, path: str):
        self._library = library
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
        library.hid_init()
        self._device = int(library.hid_open_path(path.encode()) or 0)
        if not self._device:
            raise OSError(f"hidapi cannot open {path}")

    def _call_target(self, name: str) -> IntArray:
        return np.array([address_of(getattr(self._library, name)), self._device], np.int64)

    def transfers(self, incoming: Bytes, outgoing: Bytes) -> tuple[Callable[[int], int], Callable[[], int]]:
        """Functions that receive a report into `incoming` within a timeout [ms], and that send `outgoing`.

        Each returns the number of bytes; sending returns −1 on an error, receiving raises OSError.
        """
        read_io, write_io = np.zeros(2), np.zeros(1)
        call_read = BoundCall(read_report, (self._call_target("hid_read_timeout"), incoming, read_io))
        call_write = BoundCall(write_report, (self._call_target("hid_write"), outgoing, write_io))
        read_items, write_items = items(read_io), items(write_io)

        def receive(timeout_ms: int) -> int:
            read_items[0], read_items[1] = timeout_ms, -1.0
            if self._device:
                call_read()
            if read_items[1] < 0.0:
                raise OSError("read error")
            return int(read_items[1])

        def send() -> int:
            write_items[0] = -1.0
            if self._device:
                call_write()
            return int(write_items[0])

        return receive, send

    def get_feature_report(self, report_num: int, max_length: int) -> list[int]:
        """As hidapi's binding."""
        buffer = ctypes.create_string_buffer(bytes([report_num]), max_length)
        size = self._library.hid_get_feature_report(self._device, buffer, max_length) if self._device else -1
        if size < 0:
            raise OSError("read error")
        return list(buffer.raw[:size])

    def send_feature_report(self, buff: bytes) -> int:
        """As hidapi's binding."""
        return self._library.hid_send_feature_report(self._device, buff, len(buff)) if self._device else -1

    def set_nonblocking(self, value: bool) -> int:
        """As hidapi's binding."""
        return self._library.hid_set_nonblocking(self._device, int(value))

    def close(self) -> None:
        """Close the node; all later transfers are errors."""
        if self._device:
            self._library.hid_close(self._device)
        self._device = 0
