"""Force Dimension's DHD: omega, delta, sigma and Falcon devices through their vendor's library.

Positions are in metres and forces in newtons, in axes with x towards the user, y to the right and z up, from the middle
of the workspace, which is taken for H's origin. The library compensates for the device's weight by itself. Signatures
are those of the SDK's ``dhdc.h``.
"""

import ctypes
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from controllers.safety.faults import Fault
from controllers.state import Array
from models.phantom.kinematics import R_HP
from sim.devices.driver import READ, DeviceIdentity, DriverFault, fresh_telemetry
from sim.devices.exchange import READING_CLOCK, READING_SEQUENCE, READING_SIZE, READING_SWITCH, READING_THETA
from sim.devices.hid import WATCHDOG
from sim.devices.vendor_library import VendorLibrary
from sim.devices.virtual_arm import tip_force, write_pose
from sim.errors import SimError

LARGEST = 8.5
"""Largest force that is sent [N]: the Premium's at its stall. Falcon, omega and delta give 8 to 20 and more."""

_R_HD = np.diag([-1.0, -1.0, 1.0])  # from the library's axes D to H
_TIME_GUARD = 1  # nothing new since the last call
_WATCHDOG_UNIT = 125e-6  # s
_ERROR_COM, _ERROR_TIMEOUT, _ERROR_NO_DEVICE = 2, 7, 5

_double_p = ctypes.POINTER(ctypes.c_double)
_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "dhdOpen": (ctypes.c_int, []),
    "dhdClose": (ctypes.c_int, [ctypes.c_char]),
    "dhdGetSystemName": (ctypes.c_char_p, [ctypes.c_char]),
    "dhdGetSerialNumber": (ctypes.c_int, [ctypes.POINTER(ctypes.c_ushort), ctypes.c_char]),
    "dhdGetPositionAndOrientationFrame": (
        ctypes.c_int, [_double_p, _double_p, _double_p, _double_p, ctypes.c_char],
    ),
    "dhdGetButton": (ctypes.c_int, [ctypes.c_int, ctypes.c_char]),
    "dhdSetForce": (ctypes.c_int, [ctypes.c_double, ctypes.c_double, ctypes.c_double, ctypes.c_char]),
    "dhdEnableForce": (ctypes.c_int, [ctypes.c_ubyte, ctypes.c_char]),
    "dhdSetWatchdog": (ctypes.c_int, [ctypes.c_ubyte, ctypes.c_char]),
    "dhdErrorGetLast": (ctypes.c_int, []),
    "dhdErrorGetLastStr": (ctypes.c_char_p, []),
}  # fmt: skip


DHD = VendorLibrary(
    "Force Dimension's library dhd", ("dhd", "dhd64.dll"),
    "install the Force Dimension SDK, so that libdhd.so (dhd64.dll) is found", _SIGNATURES,
)  # fmt: skip


class DhdDevice:
    """The driver of a device behind DHD (see `sim.devices.driver.Driver`).

    Parameters
    ----------
    library : ctypes.CDLL
        `DHD`, loaded.
    clock : callable
        Seconds, which the readings carry.

    Raises
    ------
    SimError
        If there is no device.
    """

    def __init__(self, library: ctypes.CDLL, clock: Callable[[], float] = time.perf_counter):
        self._dhd, self._clock = library, clock
        device = library.dhdOpen()
        if device < 0:
            raise SimError(f"DHD opens no device: {self._words()}; expected one that is connected and switched on")
        self._id = bytes([device])
        serial = ctypes.c_ushort(0)
        library.dhdGetSerialNumber(ctypes.byref(serial), self._id)
        watchdog = library.dhdSetWatchdog(round(WATCHDOG / _WATCHDOG_UNIT), self._id) == 0
        name = (library.dhdGetSystemName(self._id) or b"").decode(errors="replace")
        self.identity = DeviceIdentity(name, "DHD", str(serial.value), "", True, watchdog, True, own_weight=True)
        self.telemetry = fresh_telemetry()
        self._theta, self._taken, self._enabled = np.zeros(3), 0, False

    def _words(self) -> str:
        return (self._dhd.dhdErrorGetLastStr() or b"").decode(errors="replace")

    def _fault(self) -> DriverFault:
        code = self._dhd.dhdErrorGetLast()
        gone = code in (_ERROR_COM, _ERROR_TIMEOUT, _ERROR_NO_DEVICE)
        return DriverFault(Fault.UNPLUGGED if gone else Fault.DEVICE_REPORTED, code, self._words())

    def read(self, reading: Array, timeout: float) -> bool:
        """See `sim.devices.driver.Driver.read`; the library waits for nothing, so this neither.

        Raises
        ------
        DriverFault
            If the library reported an error, or the tip is where no Phantom's can be.
        """
        room = (ctypes.c_double * 12)()
        addresses = [ctypes.cast(ctypes.byref(room, 8 * k), _double_p) for k in range(4)]
        result = self._dhd.dhdGetPositionAndOrientationFrame(*addresses, self._id)
        if result == _TIME_GUARD:
            return False
        if result < 0:
            raise self._fault()
        pose = np.array(room)
        p_P = np.array(R_HP).T @ _R_HD @ pose[:3]
        told = np.zeros(READING_SIZE)
        write_pose(told, p_P, _R_HD @ pose[3:].reshape(3, 3) @ _R_HD)
        reading[:] = told
        self._theta = told[READING_THETA : READING_THETA + 3]
        self._taken += 1
        reading[READING_SWITCH] = float(self._dhd.dhdGetButton(0, self._id) == 1)
        reading[READING_CLOCK] = self._clock()
        self.telemetry[READ] = reading[READING_SEQUENCE] = self._taken
        return True

    def write(self, torque: Array, enable: bool) -> None:
        """See `sim.devices.driver.Driver.write`: the force at the tip that the torques stand for.

        Raises
        ------
        DriverFault
            If the library reported an error, or a torque is not finite: then the motors are off.
        """
        total = float(np.sum(torque))
        if not math.isfinite(total):
            self.let_go()
            raise DriverFault(Fault.FORCE_NOT_FINITE, total)
        force = tip_force(self._theta, torque, LARGEST) if enable else np.zeros(3)
        result = 0
        if enable != self._enabled:
            result = self._dhd.dhdEnableForce(int(enable), self._id)
            self._enabled = enable
        result = min(result, self._dhd.dhdSetForce(*(_R_HD @ np.array(R_HP) @ force), self._id))
        if result < 0:
            raise self._fault()

    def let_go(self) -> None:
        """Motors off, at once; never raises."""
        self._dhd.dhdSetForce(0.0, 0.0, 0.0, self._id)
        self._dhd.dhdEnableForce(0, self._id)
        self._enabled = False

    def close(self) -> None:
        """Let go, and give the device back."""
        self.let_go()
        self._dhd.dhdClose(self._id)
