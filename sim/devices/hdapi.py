"""Driver for Phantom and Touch devices through the vendor's library, OpenHaptics' HDAPI.

The library may not be redistributed; it is loaded by ctypes where it is installed. Its scheduler calls back at 1 kHz in
a thread of its own: that callback is compiled (`hdapi_frame.py`) and only reads the state and commands the last force.
Positions are in millimetres, in the axes of the device frame P (x right, y up, z to the user), from the middle of the
workspace, which is taken as P's origin; the end effector's frame is parallel to P when the pen points away from the
user.

Constants and signatures are those of OpenHaptics 3.4's ``hd.h``, ``hdDefines.h``, ``hdDevice.h`` and ``hdScheduler.h``.
"""

import ctypes
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from controllers.safety.faults import Fault
from geometry.arrays import Array
from sim.compilation.bound_call import BoundCall, keep_arguments
from sim.compilation.c_function import address_of
from sim.compilation.memory_access import items
from sim.compilation.python_clock import clock_for_c
from sim.devices import hdapi_frame as frame
from sim.devices.driver import DeviceIdentity, DriverFault, make_telemetry
from sim.devices.hdapi_frame import HdMemory, frame_for_c, send_force, take_sample
from sim.devices.vendor_library import VendorLibrary
from sim.devices.virtual_arm import pose_fault
from sim.errors import SimError

RATE = 1000  # [Hz] of the vendor's scheduler
_POLL_INTERVAL = 5e-5  # [s] polling interval for a new sample

_INVALID_HANDLE = 0xFFFFFFFF
_MAX_PRIORITY = 0xFFFF
_MODEL, _SERIAL, _CALIBRATION_STYLE, _MAX_FORCE = 0x2501, 0x2504, 0x2555, 0x2603
_FORCE_OUTPUT, _MAX_FORCE_CLAMPING, _SOFTWARE_FORCE_LIMIT = 0x4000, 0x4001, 0x4003
_CALIBRATION_OK, _CALIBRATION_NEEDS_UPDATE = 0x5000, 0x5001

ERRORS = {
    0x0100: "HD_INVALID_ENUM", 0x0101: "HD_INVALID_VALUE", 0x0102: "HD_INVALID_OPERATION",
    0x0103: "HD_INVALID_INPUT_TYPE", 0x0104: "HD_BAD_HANDLE", 0x0200: "HD_WARM_MOTORS",
    0x0201: "HD_EXCEEDED_MAX_FORCE", 0x0202: "HD_EXCEEDED_MAX_FORCE_IMPULSE", 0x0203: "HD_EXCEEDED_MAX_VELOCITY",
    0x0204: "HD_FORCE_ERROR", 0x0300: "HD_DEVICE_FAULT", 0x0301: "HD_DEVICE_ALREADY_INITIATED",
    0x0302: "HD_COMM_ERROR", 0x0303: "HD_COMM_CONFIG_ERROR", 0x0304: "HD_TIMER_ERROR", 0x0400: "HD_ILLEGAL_BEGIN",
    0x0401: "HD_ILLEGAL_END", 0x0402: "HD_FRAME_ERROR", 0x0500: "HD_INVALID_PRIORITY", 0x0501: "HD_SCHEDULER_FULL",
    0x0600: "HD_INVALID_LICENSE",
}  # fmt: skip
"""Names of all errors of the library, by number."""

_FAULTS = {0x0200: Fault.MOTORS_HOT, 0x0203: Fault.TOO_FAST, 0x0302: Fault.UNPLUGGED}


class ErrorInfo(ctypes.Structure):
    """The library's struct HDErrorInfo."""

    _fields_ = [("errorCode", ctypes.c_uint), ("internalErrorCode", ctypes.c_int), ("hHD", ctypes.c_uint)]


_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "hdInitDevice": (ctypes.c_uint, [ctypes.c_char_p]),
    "hdDisableDevice": (None, [ctypes.c_uint]),
    "hdMakeCurrentDevice": (None, [ctypes.c_uint]),
    "hdBeginFrame": (None, [ctypes.c_uint]),
    "hdEndFrame": (None, [ctypes.c_uint]),
    "hdEnable": (None, [ctypes.c_uint]),
    "hdDisable": (None, [ctypes.c_uint]),
    "hdGetDoublev": (None, [ctypes.c_uint, ctypes.POINTER(ctypes.c_double)]),
    "hdGetIntegerv": (None, [ctypes.c_uint, ctypes.POINTER(ctypes.c_int)]),
    "hdGetString": (ctypes.c_char_p, [ctypes.c_uint]),
    "hdSetDoublev": (None, [ctypes.c_uint, ctypes.POINTER(ctypes.c_double)]),
    "hdGetError": (ErrorInfo, []),
    "hdGetErrorString": (ctypes.c_char_p, [ctypes.c_uint]),
    "hdCheckCalibration": (ctypes.c_uint, []),
    "hdUpdateCalibration": (None, [ctypes.c_uint]),
    "hdSetSchedulerRate": (None, [ctypes.c_ulong]),
    "hdStartScheduler": (None, []),
    "hdStopScheduler": (None, []),
    "hdScheduleAsynchronous": (ctypes.c_ulong, [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_ushort]),
    "hdUnschedule": (None, [ctypes.c_ulong]),
}


HDAPI = VendorLibrary(
    "OpenHaptics' library HD", ("HD", "HD.dll"),
    "install 3D Systems' OpenHaptics and the Touch (or Phantom) device driver, so that libHD.so (HD.dll) is found",
    _SIGNATURES,
)  # fmt: skip


class HdapiDevice:
    """The driver of a device behind HDAPI (see `sim.devices.driver.Driver`).

    Parameters
    ----------
    library : ctypes.CDLL
        `HDAPI`, loaded.
    name : str
        The device's name in the vendor's configuration; empty for the default device.
    clock : callable
        Clock that timestamps the readings [s]; any but `time.perf_counter` is called with the GIL held.

    Raises
    ------
    SimError
        If the library has no such device, or its scheduler does not start.
    """

    def __init__(self, library: ctypes.CDLL, name: str = "", clock: Callable[[], float] = time.perf_counter):
        self._hd, self._clock = library, clock_for_c(clock)
        self._device: int = library.hdInitDevice(name.encode() or None)
        code = self._take_error()
        if code or self._device == _INVALID_HANDLE:
            raise SimError(
                f"HDAPI does not open {name or 'the default device'}: {_symbol(code)}; expected a name of the vendor's "
                "set-up, and the device switched on"
            )
        self.telemetry = make_telemetry()
        self.identity = self._read_identity(self._ensure_calibrated())
        functions = *(getattr(library, name) for name in frame.FUNCTIONS), self._clock
        addresses = [address_of(function) for function in functions]
        memory = HdMemory.fresh(addresses, self._device, self._read_nominal_force(), self.telemetry)
        self._memory, self._io, self._zero_torque = memory, items(memory.io), np.zeros(3)
        self._take_sample, self._send_force = BoundCall(take_sample, (memory,)), BoundCall(send_force, (memory,))
        for capability in (_MAX_FORCE_CLAMPING, _SOFTWARE_FORCE_LIMIT):
            library.hdEnable(capability)
        # The arguments are never freed: the vendor's thread may use them after this driver is gone.
        self._task = library.hdScheduleAsynchronous(frame_for_c(), keep_arguments(memory), _MAX_PRIORITY)
        library.hdSetSchedulerRate(RATE)
        library.hdStartScheduler()
        code = self._take_error()
        if code:
            library.hdUnschedule(self._task)
            library.hdDisableDevice(self._device)
            raise SimError(f"HDAPI does not start its scheduler at {RATE} Hz: {_symbol(code)}")
        _clocks_in_use[addresses[-1]] = self._clock

    def _take_error(self) -> int:
        """Empty the library's error stack and return its first error, 0 if there was none."""
        first = 0
        for _ in range(len(ERRORS)):
            code = int(self._hd.hdGetError().errorCode)
            if code == 0:
                break
            first = first or code
        return first

    def _read_nominal_force(self) -> float:
        buffer = ctypes.c_double(0.0)
        self._hd.hdGetDoublev(_MAX_FORCE, ctypes.byref(buffer))
        return buffer.value

    def _read_integer(self, parameter: int) -> int:
        buffer = ctypes.c_int(0)
        self._hd.hdGetIntegerv(parameter, ctypes.byref(buffer))
        return buffer.value

    def _ensure_calibrated(self) -> bool:
        """Let a device that can calibrate itself do so; returns whether the zero of the encoders is known."""
        if self._hd.hdCheckCalibration() == _CALIBRATION_NEEDS_UPDATE:
            self._hd.hdUpdateCalibration(self._read_integer(_CALIBRATION_STYLE))
        return self._hd.hdCheckCalibration() == _CALIBRATION_OK

    def _read_identity(self, calibrated: bool) -> DeviceIdentity:
        name, serial = (self._hd.hdGetString(which) or b"" for which in (_MODEL, _SERIAL))
        # The library documents no watchdog of the device, so none is assumed.
        return DeviceIdentity(
            name.decode(errors="replace"), "HDAPI", serial.decode(errors="replace"), "", True, False, calibrated,
            own_weight=True,
        )  # fmt: skip

    def read(self, reading: Array, timeout: float) -> bool:
        """See `sim.devices.driver.Driver.read`.

        Raises
        ------
        DriverFault
            If the library reported an error, or the Phantom cannot reach the pose.
        """
        io, take = self._io, self._take_sample
        take()
        deadline = time.monotonic() + timeout
        while io[frame.IO_NEW] == 0.0 and io[frame.IO_CODE] == 0.0 and time.monotonic() < deadline:
            time.sleep(_POLL_INTERVAL)
            take()
        if io[frame.IO_CODE] != 0.0:
            code = int(io[frame.IO_CODE])
            raise DriverFault(_FAULTS.get(code, Fault.DEVICE_REPORTED), io[frame.IO_VALUE], _symbol(code))
        if io[frame.IO_FAULT] != 0.0:
            raise pose_fault(io[frame.IO_FAULT], io[frame.IO_VALUE])
        if io[frame.IO_NEW] == 0.0:
            return False
        np.copyto(reading, self._memory.reading)
        return True

    def write(self, torque: Array, enable: bool) -> None:
        """See `sim.devices.driver.Driver.write`; the equivalent tip force acts from the next callback on.

        Raises
        ------
        DriverFault
            If a torque is not finite; the force is then zero.
        """
        io = self._io
        np.copyto(self._memory.torque, torque)
        io[frame.IO_ENABLE] = enable
        self._send_force()
        if io[frame.IO_FAULT] != 0.0:
            raise DriverFault(Fault.FORCE_NOT_FINITE, io[frame.IO_VALUE])

    def let_go(self) -> None:
        """Switch the motors off with the next callback; never raises."""
        np.copyto(self._memory.torque, self._zero_torque)
        self._io[frame.IO_ENABLE] = 0.0
        self._send_force()

    def close(self) -> None:
        """Switch the motors off, stop the scheduler and close the device."""
        self.let_go()
        self._memory.numbers[frame.N_CLOSING] = 1
        self._hd.hdDisable(_FORCE_OUTPUT)
        self._hd.hdStopScheduler()
        self._hd.hdUnschedule(self._task)
        self._hd.hdDisableDevice(self._device)
        _clocks_in_use.pop(address_of(self._clock), None)


_clocks_in_use: dict[int, Any] = {}
"""Clocks by address, kept alive here because a vendor's thread may call them after their driver is gone."""


def _symbol(code: int) -> str:
    return ERRORS.get(code, f"error {code:#06x}")
