"""OpenHaptics' HDAPI: how Phantoms and Touch devices with their vendor's driver take forces.

The library is not ours to ship; it is loaded by ctypes where it is installed. Its scheduler calls back at its own rate
(1 kHz) in its own thread: there the state is read and the last force commanded, and nothing else is done. Positions
are in millimetres, in axes that are the device frame's P (x right, y up, z to the user), from the middle of the
workspace, which is taken for P's origin; the end effector's frame is parallel to P when the pen points away from the
user.

Constants and signatures are those of OpenHaptics 3.4's ``hd.h``, ``hdDefines.h``, ``hdDevice.h`` and ``hdScheduler.h``.
"""

import ctypes
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from controllers.safety.faults import Fault
from controllers.state import Array
from models.phantom.kinematics import R_HP
from sim.devices.driver import READ, DeviceIdentity, DriverFault, fresh_telemetry
from sim.devices.exchange import READING_CLOCK, READING_SEQUENCE, READING_SIZE, READING_SWITCH, READING_THETA
from sim.devices.vendor_library import VendorLibrary
from sim.devices.virtual_arm import tip_force, write_pose
from sim.errors import SimError

SILENCE = 5e-3
"""Time without a command after which the callback commands no force [s]; five of its periods."""
RATE = 1000  # Hz, of the vendor's scheduler

_INVALID_HANDLE = 0xFFFFFFFF
_CALLBACK_DONE, _CALLBACK_CONTINUE, _MAX_PRIORITY = 0, 1, 0xFFFF
_BUTTONS, _POSITION, _VELOCITY, _TRANSFORM, _GIMBAL = 0x2000, 0x2050, 0x2051, 0x2052, 0x2150
_MODEL, _SERIAL, _CALIBRATION_STYLE = 0x2501, 0x2504, 0x2555
_MAX_FORCE, _MOTOR_TEMPERATURE, _CURRENT_FORCE = 0x2603, 0x2605, 0x2700
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
"""Every error that the library has, by its number."""

_FAULTS = {0x0200: Fault.MOTORS_HOT, 0x0203: Fault.TOO_FAST, 0x0302: Fault.UNPLUGGED}


class ErrorInfo(ctypes.Structure):
    """HDErrorInfo."""

    _fields_ = [
        ("errorCode", ctypes.c_uint), ("internalErrorCode", ctypes.c_int), ("hHD", ctypes.c_uint),
    ]  # fmt: skip


Callback = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_void_p)

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
    "hdScheduleAsynchronous": (ctypes.c_ulong, [Callback, ctypes.c_void_p, ctypes.c_ushort]),
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
        The device's name in the vendor's set-up; the default device where it is empty.
    clock : callable
        Seconds, which the readings carry.

    Raises
    ------
    SimError
        If the library has no such device, or its scheduler does not start.
    """

    def __init__(self, library: ctypes.CDLL, name: str = "", clock: Callable[[], float] = time.perf_counter):
        self._hd, self._clock = library, clock
        self._device: int = library.hdInitDevice(name.encode() or None)
        code = self._error()
        if code or self._device == _INVALID_HANDLE:
            raise SimError(
                f"HDAPI does not open {name or 'the default device'}: {_words(code)}; expected a name of the vendor's "
                "set-up, and the device switched on"
            )
        self.telemetry = fresh_telemetry()
        self.identity = self._who(self._calibrated())
        self._largest = float(self._doubles(_MAX_FORCE, 1)[0])
        self._lock = threading.Condition()
        self._sample, self._samples, self._taken = np.zeros(_SAMPLE), 0, 0
        self._theta, self._force = np.zeros(3), np.zeros(3)
        self._commanded, self._enable, self._enabled = -np.inf, False, False
        self._pending: tuple[int, float] = (0, 0.0)
        self._closing = False
        self._callback = Callback(self._serve)  # the library keeps its address only
        for ability in (_MAX_FORCE_CLAMPING, _SOFTWARE_FORCE_LIMIT):
            library.hdEnable(ability)
        self._task = library.hdScheduleAsynchronous(self._callback, None, _MAX_PRIORITY)
        library.hdSetSchedulerRate(RATE)
        library.hdStartScheduler()
        code = self._error()
        if code:
            library.hdDisableDevice(self._device)
            raise SimError(f"HDAPI does not start its scheduler at {RATE} Hz: {_words(code)}")

    def _error(self) -> int:
        """The first of the errors that the library has kept, all of which are taken; 0 if there is none."""
        first = 0
        for _ in range(len(ERRORS)):
            code = int(self._hd.hdGetError().errorCode)
            if code == 0:
                break
            first = first or code
        return first

    def _doubles(self, parameter: int, n: int) -> Array:
        room = (ctypes.c_double * n)()
        self._hd.hdGetDoublev(parameter, room)
        return np.array(room)

    def _integer(self, parameter: int) -> int:
        room = ctypes.c_int(0)
        self._hd.hdGetIntegerv(parameter, ctypes.byref(room))
        return room.value

    def _calibrated(self) -> bool:
        """Whether the encoders know their zero; a device that can do it by itself is asked to."""
        if self._hd.hdCheckCalibration() == _CALIBRATION_NEEDS_UPDATE:
            self._hd.hdUpdateCalibration(self._integer(_CALIBRATION_STYLE))
        return self._hd.hdCheckCalibration() == _CALIBRATION_OK

    def _who(self, calibrated: bool) -> DeviceIdentity:
        name, serial = (self._hd.hdGetString(which) or b"" for which in (_MODEL, _SERIAL))
        # The library documents no watchdog of the device: one without, then.
        return DeviceIdentity(
            name.decode(errors="replace"), "HDAPI", serial.decode(errors="replace"), "", True, False, calibrated,
            own_weight=True,
        )  # fmt: skip

    def _serve(self, _: int | None) -> int:
        """What the vendor's scheduler calls: state in, force out."""
        hd = self._hd
        if self._closing:
            return _CALLBACK_DONE
        hd.hdBeginFrame(self._device)
        sample = np.concatenate([
            self._doubles(_POSITION, 3), self._doubles(_TRANSFORM, 16), self._doubles(_VELOCITY, 3),
            [self._integer(_BUTTONS)],
        ])  # fmt: skip
        with self._lock:
            alive = self._enable and self._clock() - self._commanded <= SILENCE
            force = self._force if alive else np.zeros(3)
            enable = self._enable
        if enable != self._enabled:
            (hd.hdEnable if enable else hd.hdDisable)(_FORCE_OUTPUT)
            self._enabled = enable
        hd.hdSetDoublev(_CURRENT_FORCE, (ctypes.c_double * 3)(*force))
        hd.hdEndFrame(self._device)
        code = self._error()
        with self._lock:
            if code and not self._pending[0]:
                self._pending = code, self._evidence(code, sample)
            self._sample, self._samples = sample, self._samples + 1
            self._lock.notify_all()
        return _CALLBACK_CONTINUE

    def _evidence(self, code: int, sample: Array) -> float:
        if code == 0x0200:
            return float(np.max(self._doubles(_MOTOR_TEMPERATURE, 6)))
        return float(np.linalg.norm(sample[_SPEED])) * 1e-3 if code == 0x0203 else float(code)

    def read(self, reading: Array, timeout: float) -> bool:
        """See `sim.devices.driver.Driver.read`.

        Raises
        ------
        DriverFault
            If the library reported an error, or the tip is where no Phantom's can be.
        """
        with self._lock:
            new = self._lock.wait_for(lambda: self._samples > self._taken or self._pending[0] != 0, timeout)
            (code, value), self._pending = self._pending, (0, 0.0)
            sample, samples = self._sample, self._samples
        if code:
            raise DriverFault(_FAULTS.get(code, Fault.DEVICE_REPORTED), value, _words(code))
        if not new:
            return False
        self._taken = samples
        rows = np.array(R_HP)
        r_PE = sample[_ROTATION].reshape(4, 4).T[:3, :3]  # OpenGL's order: column by column
        told = np.zeros(READING_SIZE)
        write_pose(told, sample[:3] * 1e-3, rows @ r_PE @ rows.T)
        reading[:] = told
        self._theta = told[READING_THETA : READING_THETA + 3]
        reading[READING_SWITCH] = float(int(sample[-1]) & 1)
        reading[READING_CLOCK] = self._clock()
        self.telemetry[READ] = samples
        reading[READING_SEQUENCE] = samples
        return True

    def write(self, torque: Array, enable: bool) -> None:
        """See `sim.devices.driver.Driver.write`: the force that the torques stand for, from the next callback on.

        Raises
        ------
        DriverFault
            If a torque is not finite: then there is no force.
        """
        if not np.all(np.isfinite(torque)):
            self.let_go()
            raise DriverFault(Fault.FORCE_NOT_FINITE, float(np.sum(torque)))
        force = tip_force(self._theta, torque, self._largest) if enable else np.zeros(3)
        with self._lock:
            self._force, self._enable, self._commanded = force, enable, self._clock()

    def let_go(self) -> None:
        """Motors off with the next callback; never raises."""
        with self._lock:
            self._force, self._enable = np.zeros(3), False

    def close(self) -> None:
        """Let go, and give the device back."""
        self.let_go()
        self._closing = True
        self._hd.hdDisable(_FORCE_OUTPUT)
        self._hd.hdStopScheduler()
        self._hd.hdUnschedule(self._task)
        self._hd.hdDisableDevice(self._device)


_SAMPLE = 23
_ROTATION, _SPEED = slice(3, 19), slice(19, 22)


def _words(code: int) -> str:
    return ERRORS.get(code, f"error {code:#06x}")
