"""Driver for Force Dimension devices (omega, delta, sigma, Falcon) through the vendor's DHD library.

Positions are in metres and forces in newtons, in axes with x towards the user, y to the right and z up; their origin,
the middle of the workspace, is taken as H's origin. The library compensates for gravity itself. Signatures are those of
the SDK's ``dhdc.h``. In the loop, compiled code calls the library's functions by address.
"""

import ctypes
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from controllers.safety.faults import Fault, first_not_finite
from geometry.arrays import Array, IntArray
from models.phantom.kinematics import vector_to_device_frame, vector_to_hand_frame
from sim.compilation.bound_call import BoundCall
from sim.compilation.c_function import address_of, call_int
from sim.compilation.compiled import entry_point
from sim.compilation.memory_access import items
from sim.devices.driver import READ, DeviceIdentity, DriverFault, make_telemetry
from sim.devices.exchange import READING_CLOCK, READING_SEQUENCE, READING_SIZE, READING_SWITCH, READING_THETA
from sim.devices.hid_reports import WATCHDOG_TIME
from sim.devices.vendor_library import VendorLibrary
from sim.devices.virtual_arm import place_stylus, pose_fault, tip_force
from sim.errors import SimError

MAX_FORCE = 8.5
"""Largest force that is sent [N]: the stall force of the Premium. Falcon, omega and delta reach 8 to 20 N or more."""

_SIGNS = np.array([-1.0, -1.0, 1.0])  # diagonal of the rotation from the library's axes D to H
_TIME_GUARD = 1  # result of a call if there is nothing new since the last one
_WATCHDOG_UNIT = 125e-6  # [s]
_ERROR_COM, _ERROR_TIMEOUT, _ERROR_NO_DEVICE = 2, 7, 5
_MOTOR_STATE_UNKNOWN = -1.0  # state of the motors is unknown: the next command sends it again
_FORCE_NOT_FINITE = int(Fault.FORCE_NOT_FINITE)

_double_pointer = ctypes.POINTER(ctypes.c_double)
_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "dhdOpen": (ctypes.c_int, []),
    "dhdClose": (ctypes.c_int, [ctypes.c_char]),
    "dhdGetSystemName": (ctypes.c_char_p, [ctypes.c_char]),
    "dhdGetSerialNumber": (ctypes.c_int, [ctypes.POINTER(ctypes.c_ushort), ctypes.c_char]),
    "dhdGetPositionAndOrientationFrame": (
        ctypes.c_int, [_double_pointer, _double_pointer, _double_pointer, _double_pointer, ctypes.c_char],
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

_LOOP_FUNCTIONS = "dhdGetPositionAndOrientationFrame", "dhdGetButton", "dhdSetForce", "dhdEnableForce"
_GET_POSE, _GET_BUTTON, _SET_FORCE, _ENABLE_FORCE = range(len(_LOOP_FUNCTIONS))
IO_RESULT, IO_FAULT, IO_VALUE, IO_ENABLE, IO_ENABLED, IO_SIZE = range(6)
"""Places in `DhdMemory.io`: the library's result, negative for an error; the fault of a pose or a torque, with its
value; 1 if the motors are to be on; 1 if they are on."""


class DhdMemory(NamedTuple):
    """The state of a device in compiled code.

    Attributes
    ----------
    functions : IntArray
        Addresses of the library's functions, in the order of `_LOOP_FUNCTIONS`.
    number : int
        The device's number in the library.
    pose : Array
        Pose as the library returns it: tip [m], and the rotation matrix of the stylus by rows, shape (12,).
    frame : Array
        The stylus's orientation in H, shape (3, 3).
    reading : Array
        The last valid reading, of `READING_SIZE`.
    torque : Array
        Joint torques to be commanded [N m], shape (3,).
    io : Array
        Results of the kernels, see `IO_RESULT`.
    """

    functions: IntArray
    number: int
    pose: Array
    frame: Array
    reading: Array
    torque: Array
    io: Array


@entry_point
def take_pose(dhd: DhdMemory) -> None:
    """Get pose and button from the library, and write them into the reading."""
    io, pose, number = dhd.io, dhd.pose, np.int32(dhd.number)
    io[IO_FAULT] = 0.0
    address = pose.ctypes.data
    io[IO_RESULT] = call_int(dhd.functions[_GET_POSE], (address, address + 8, address + 16, address + 24, number))
    if io[IO_RESULT] < 0.0 or io[IO_RESULT] == _TIME_GUARD:
        return
    for i in range(3):
        for j in range(3):
            dhd.frame[i, j] = _SIGNS[i] * pose[3 + 3 * i + j] * _SIGNS[j]
    p_P = vector_to_device_frame((_SIGNS[0] * pose[0], _SIGNS[1] * pose[1], _SIGNS[2] * pose[2]))
    io[IO_FAULT], io[IO_VALUE] = place_stylus(dhd.reading, p_P, dhd.frame)
    pressed = call_int(dhd.functions[_GET_BUTTON], (np.int32(0), number)) == 1
    dhd.reading[READING_SWITCH] = 1.0 if pressed else 0.0


@entry_point
def send_force(dhd: DhdMemory) -> None:
    """Send the library the tip force equivalent to the torques; zero if the motors are off or a torque not finite."""
    io, reading, torque, number = dhd.io, dhd.reading, dhd.torque, np.int32(dhd.number)
    io[IO_VALUE] = first_not_finite(torque)
    io[IO_FAULT] = 0.0 if io[IO_VALUE] == 0.0 else _FORCE_NOT_FINITE
    enable = io[IO_ENABLE] if io[IO_FAULT] == 0.0 else 0.0
    force = 0.0, 0.0, 0.0
    if enable > 0.0:
        theta = (reading[READING_THETA], reading[READING_THETA + 1], reading[READING_THETA + 2])
        force = vector_to_hand_frame(tip_force(theta, (torque[0], torque[1], torque[2]), MAX_FORCE))
    io[IO_RESULT] = 0.0
    if enable != io[IO_ENABLED]:
        io[IO_RESULT] = call_int(dhd.functions[_ENABLE_FORCE], (np.int32(enable), number))
        io[IO_ENABLED] = enable
    f_D = _SIGNS[0] * force[0], _SIGNS[1] * force[1], _SIGNS[2] * force[2], number
    io[IO_RESULT] = min(io[IO_RESULT], call_int(dhd.functions[_SET_FORCE], f_D))


class DhdDevice:
    """The driver of a device behind DHD (see `sim.devices.driver.Driver`).

    Parameters
    ----------
    library : ctypes.CDLL
        `DHD`, loaded.
    clock : callable
        Clock that timestamps the readings [s].

    Raises
    ------
    SimError
        If no device can be opened.
    """

    def __init__(self, library: ctypes.CDLL, clock: Callable[[], float] = time.perf_counter):
        self._dhd, self._clock = library, clock
        device = library.dhdOpen()
        if device < 0:
            raise SimError(f"DHD opens no device: {self._error_text()}; expected one that is connected and switched on")
        self._id = bytes([device])
        serial = ctypes.c_ushort(0)
        library.dhdGetSerialNumber(ctypes.byref(serial), self._id)
        watchdog = library.dhdSetWatchdog(round(WATCHDOG_TIME / _WATCHDOG_UNIT), self._id) == 0
        name = (library.dhdGetSystemName(self._id) or b"").decode(errors="replace")
        self.identity = DeviceIdentity(name, "DHD", str(serial.value), "", True, watchdog, True, own_weight=True)
        self.telemetry = make_telemetry()
        functions = np.array([address_of(getattr(library, name)) for name in _LOOP_FUNCTIONS], np.int64)
        memory = DhdMemory(
            functions, device, np.zeros(12), np.zeros((3, 3)), np.zeros(READING_SIZE), np.zeros(3), np.zeros(IO_SIZE)
        )
        self._memory, self._zero_torque, self._reading_count = memory, np.zeros(3), 0.0
        self._io, self._reading_items, self._telemetry = items(memory.io), items(memory.reading), items(self.telemetry)
        self._take_pose, self._send_force = BoundCall(take_pose, (memory,)), BoundCall(send_force, (memory,))

    def _error_text(self) -> str:
        return (self._dhd.dhdErrorGetLastStr() or b"").decode(errors="replace")

    def _library_fault(self) -> DriverFault:
        code = self._dhd.dhdErrorGetLast()
        is_unplugged = code in (_ERROR_COM, _ERROR_TIMEOUT, _ERROR_NO_DEVICE)
        return DriverFault(Fault.UNPLUGGED if is_unplugged else Fault.DEVICE_REPORTED, code, self._error_text())

    def read(self, reading: Array, timeout: float) -> bool:
        """See `sim.devices.driver.Driver.read`; the library does not block, so `timeout` is unused.

        Raises
        ------
        DriverFault
            If the library reported an error, or the Phantom cannot reach the pose.
        """
        io, reading_items = self._io, self._reading_items
        self._take_pose()
        if io[IO_RESULT] == _TIME_GUARD:
            return False
        if io[IO_RESULT] < 0.0:
            raise self._library_fault()
        if io[IO_FAULT] != 0.0:
            raise pose_fault(io[IO_FAULT], io[IO_VALUE])
        self._reading_count += 1.0
        reading_items[READING_CLOCK] = self._clock()
        reading_items[READING_SEQUENCE] = self._telemetry[READ] = self._reading_count
        np.copyto(reading, self._memory.reading)
        return True

    def write(self, torque: Array, enable: bool) -> None:
        """See `sim.devices.driver.Driver.write`; the library is sent the equivalent force at the tip.

        Raises
        ------
        DriverFault
            If the library reported an error, or a torque is not finite; the motors are then switched off.
        """
        io = self._io
        np.copyto(self._memory.torque, torque)
        io[IO_ENABLE] = enable
        self._send_force()
        if io[IO_FAULT] != 0.0:
            raise DriverFault(Fault.FORCE_NOT_FINITE, io[IO_VALUE])
        if io[IO_RESULT] < 0.0:
            raise self._library_fault()

    def let_go(self) -> None:
        """Switch the motors off at once; never raises."""
        np.copyto(self._memory.torque, self._zero_torque)
        self._io[IO_ENABLE], self._io[IO_ENABLED] = 0.0, _MOTOR_STATE_UNKNOWN
        self._send_force()

    def close(self) -> None:
        """Switch the motors off and close the device."""
        self.let_go()
        self._dhd.dhdClose(self._id)
