"""A user-defined device: a class in a file, which reports the stylus's pose and takes a force at its tip.

``hvf hardware run --device haply.py:Haply`` opens the class `Haply` of the file ``haply.py``. The device is treated as
a virtual Phantom (`sim.devices.virtual_arm`): gate, watchdog of readings, certificate and recorder are those of every
other device.
"""

import contextlib
import importlib.util
import math
import sys
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar, NamedTuple, TypeVar

import numpy as np

from controllers.checks import check_kind
from controllers.safety.faults import Fault
from geometry.arrays import Array
from models.phantom.kinematics import R_HP
from sim.devices.driver import READ, DeviceIdentity, DriverFault, make_telemetry
from sim.devices.exchange import READING_CLOCK, READING_SEQUENCE, READING_SIZE, READING_SWITCH, READING_THETA
from sim.devices.virtual_arm import force_at_tip, write_pose
from sim.errors import SimError

_Result = TypeVar("_Result")


class TipPose(NamedTuple):
    """What a user-defined device reads.

    Attributes
    ----------
    position : Array
        Position of the tip in the hand frame H [m], shape (3,): x away from the user, y to the left, z up.
    orientation : Array
        Rotation matrix R_HS of the stylus in H, shape (3, 3).
    pressed : bool
        Whether the stylus's switch is pressed.
    """

    position: Array
    orientation: Array = np.eye(3)
    pressed: bool = False


class TipDevice(ABC):
    """A user-defined device, made without arguments; a subclass opens its device in ``__init__``.

    Whatever `read` or `write` raises is a fault: the force is released, and the error is printed once.

    Attributes
    ----------
    name, serial : str
        For display; by default the class's name and nothing.
    watchdog : bool
        Whether its firmware switches the motors off when commands stop.
    largest_force : float
        Largest force that `write` is given [N], positive; by default the stall force of the Phantom Premium 1.5.
    """

    name: ClassVar[str] = ""
    serial: ClassVar[str] = ""
    watchdog: ClassVar[bool] = False
    largest_force: ClassVar[float] = 8.5

    @abstractmethod
    def read(self) -> TipPose | None:
        """The newest pose, or None if there is no new one; called once per servo period, so it must not wait."""

    def write(self, force: Array) -> None:  # noqa: B027  # without motors it does nothing
        """Exert a force at the tip, in H [N], shape (3,); the device compensates for its own weight.

        A device that does not override this has no motors.
        """

    def release(self) -> None:  # noqa: B027
        """Switch the motors off; called every period in which no force is allowed, and at the end."""

    def close(self) -> None:  # noqa: B027
        """Close the device, after `release`."""


class TipDriver:
    """The driver of a user-defined device (see `sim.devices.driver.Driver`).

    Parameters
    ----------
    device : TipDevice
        Open; owned from here on.
    transport : str
        File and class, for display.
    clock : callable
        Clock that timestamps the readings [s].

    Raises
    ------
    SimError
        If the device's largest force is not positive and finite.
    ParameterError
        If it is not a number.
    """

    def __init__(self, device: TipDevice, transport: str, clock: Callable[[], float] = time.perf_counter):
        check_kind(f"{transport}: largest_force", device.largest_force, float)
        if not 0.0 < device.largest_force < math.inf:
            raise SimError(f"{transport}: largest_force is {device.largest_force}; expected a finite force above 0 N")
        self._device, self._clock = device, clock
        name, forces = device.name or type(device).__name__, type(device).write is not TipDevice.write
        self.identity = DeviceIdentity(
            name, transport, device.serial, "", forces, device.watchdog, True, own_weight=True
        )  # fmt: skip
        self.telemetry = make_telemetry()
        self._reading, self._force = np.zeros(READING_SIZE), np.zeros(3)
        self._printed = list[str]()
        # Compiled now: while the servo warms up there is no force, and perhaps no reading yet.
        write_pose(np.zeros(READING_SIZE), np.zeros(3), np.eye(3))
        force_at_tip(np.zeros(3), np.zeros(3), device.largest_force, np.zeros(3))

    def read(self, reading: Array, timeout: float) -> bool:
        """See `sim.devices.driver.Driver.read`; `timeout` is unused.

        Raises
        ------
        DriverFault
            If the device raised an error, or the Phantom cannot take the pose.
        """
        pose = self._guarded(self._device.read)
        if pose is None:
            return False
        fresh = self._reading
        position, orientation, pressed = self._guarded(lambda: _checked(pose), f"{self.identity.transport}, read")
        write_pose(fresh, np.array(R_HP).T @ position, orientation)
        self.telemetry[READ] += 1.0
        fresh[READING_SWITCH], fresh[READING_CLOCK] = float(pressed), self._clock()
        fresh[READING_SEQUENCE] = self.telemetry[READ]
        np.copyto(reading, fresh)
        return True

    def write(self, torque: Array, enable: bool) -> None:
        """See `sim.devices.driver.Driver.write`; the device is given the equivalent force at the tip.

        Raises
        ------
        DriverFault
            If the device raised an error, or a torque is not finite; the motors are then switched off.
        """
        if not np.isfinite(torque).all():
            self.let_go()
            raise DriverFault(Fault.FORCE_NOT_FINITE, float(torque[~np.isfinite(torque)][0]))
        if not enable:
            self._guarded(self._device.release)
            return
        theta = self._reading[READING_THETA : READING_THETA + 3]
        force_at_tip(theta, torque, self._device.largest_force, self._force)
        try:
            self._guarded(lambda: self._device.write(self._force.copy()))
        except DriverFault:
            self.let_go()
            raise

    def let_go(self) -> None:
        """Switch the motors off at once; never raises."""
        with contextlib.suppress(DriverFault):
            self._guarded(self._device.release)

    def close(self) -> None:
        """Switch the motors off and close the device."""
        self.let_go()
        with contextlib.suppress(DriverFault):
            self._guarded(self._device.close)

    def _guarded(self, call: Callable[[], _Result], where: str = "") -> _Result:
        """The result of a call; an error in it, in the user's code or `where`, is printed once, and becomes a fault."""
        try:
            return call()
        except Exception as error:
            words = _error_words(error, where)
            if words not in self._printed:
                self._printed.append(words)
                print(f"\n{words}", file=sys.stderr, flush=True)
            fault = Fault.UNPLUGGED if isinstance(error, OSError) else Fault.DEVICE_REPORTED
            raise DriverFault(fault, self._printed.index(words) + 1.0, words) from None


def _error_words(error: BaseException, where: str = "") -> str:
    """Where it happened, by default file and line, and the error, in one line."""
    if isinstance(error, SyntaxError):
        return f"{error.filename}:{error.lineno}: SyntaxError: {error.msg}"
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"{where or f'{frame.filename}:{frame.lineno}'}: {type(error).__name__}: {' '.join(str(error).split())}"


def _checked(pose: TipPose) -> TipPose:
    check_kind("the result of read", pose, TipPose)
    check_kind("pressed", pose.pressed, bool | int)  # bool("no") would be a pressed dead-man switch
    position, orientation = np.asarray(pose.position, np.float64), np.asarray(pose.orientation, np.float64)
    if position.shape != (3,) or orientation.shape != (3, 3):
        raise ValueError(f"read returned shapes {position.shape} and {orientation.shape}; expected (3,) and (3, 3)")
    return TipPose(position, orientation, bool(pose.pressed))


def is_own_device(name: str) -> bool:
    """Whether the name of a device is that of a class in a file, ``FILE.py:CLASS``."""
    return name.rpartition(":")[0].endswith(".py") or name.endswith(".py")


def own_device_class(name: str) -> type[TipDevice]:
    """The class of a name ``FILE.py:CLASS``.

    Raises
    ------
    SimError
        If the file cannot be read or run, or has no such class.
    """
    file, _, wanted = name.rpartition(":") if not name.endswith(".py") else (name, "", "")
    path = Path(file)
    if not path.is_file():
        raise SimError(f"there is no file {file}; expected FILE.py:CLASS, with a subclass of hvf.TipDevice")
    spec = importlib.util.spec_from_file_location(f"hvf_device_{path.stem}", path)
    assert spec is not None  # the name ends with .py
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module  # dataclasses look their module up there
    sys.path.append(str(path.resolve().parent))  # as for a script: it may import files beside it
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise SimError(_error_words(error)) from None
    found = {
        key: value for key, value in vars(module).items()
        if isinstance(value, type) and issubclass(value, TipDevice) and value.__module__ == module.__name__
    }  # fmt: skip
    if wanted not in found:
        there = f"; there is {', '.join(found)}" if found else ""
        which = f"has no device {wanted!r}" if wanted else "is named without its class"
        raise SimError(f"{file} {which}{there}; expected FILE.py:CLASS, with a subclass of hvf.TipDevice")
    return found[wanted]


def open_own_device(name: str) -> TipDriver:
    """Open the device of a name ``FILE.py:CLASS``.

    Raises
    ------
    SimError
        As `own_device_class`, or if the class cannot be made.
    """
    device_class = own_device_class(name)
    try:
        device = device_class()
    except (Exception, SystemExit) as error:
        raise SimError(f"{name} does not open: {_error_words(error)}") from None
    return TipDriver(device, name)
