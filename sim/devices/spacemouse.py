r"""Driver for a 3Dconnexion SpaceMouse, used as a stylus without motors: deflection of its cap sets the tip's velocity.

.. math:: \dot p_H = v_{max}\,s(a_{xyz}), \qquad \omega_H = \omega_{max}\,s(a_{rot}), \qquad s(a) = a/350

beyond a dead zone and within the Phantom's workspace; a step that would leave the workspace is not taken. Reports, as
found by the `spacenav` projects: number 1 with x, y, z or with all six axes, 2 with the three rotations, each a
little-endian int16 of about ±350; 3 with a bit for each button. Axes: x right, y towards the user, z down.
"""

import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from controllers.safety.faults import Fault
from controllers.state import MAX_TIME_STEP
from geometry.arrays import Array
from models.phantom.kinematics import R_HP, inside_workspace
from models.phantom.parameters import PREMIUM_1_5
from sim.devices.driver import READ, REFUSED, DeviceIdentity, DriverFault, make_telemetry
from sim.devices.exchange import READING_CLOCK, READING_GIMBAL, READING_SEQUENCE, READING_SIZE, READING_SWITCH
from sim.devices.hid import HidHandle
from sim.devices.virtual_arm import write_pose

MAX_SPEED, MAX_ANGULAR_SPEED = 0.15, 1.5
"""Speeds at full deflection of the cap [m/s], [rad/s]: across the workspace of a river in about a second."""
FULL_DEFLECTION = 350.0
"""Axis value at full deflection."""
DEAD_ZONE = 0.03
"""Share of the full deflection below which it is taken as zero: a cap at rest may report this much."""
_TRANSLATION, _ROTATION, _BUTTONS = 1, 2, 3
# From the cap's axes to H: right is −y, towards the user −x, down −z.
_R_HC = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


class SpaceMouse:
    """The driver of a SpaceMouse behind a HID handle (see `sim.devices.driver.Driver`).

    Parameters
    ----------
    handle : HidHandle
        Open; owned from here on.
    name, transport : str
        For display.
    clock : callable
        Clock by which the velocity is integrated, and which timestamps the readings [s].
    """

    def __init__(self, handle: HidHandle, name: str, transport: str, clock: Callable[[], float] = time.perf_counter):
        self._handle, self._clock = handle, clock
        handle.set_nonblocking(True)
        self.identity = DeviceIdentity(name, transport, "", "", False, False, True)
        self.telemetry = make_telemetry()
        self._deflection, self._buttons = np.zeros(6), 0
        self._p_H = np.zeros(3)
        self._r_HS = np.eye(3)
        self._last_time: float | None = None
        self._reading_count = 0

    def read(self, reading: Array, timeout: float) -> bool:
        """See `sim.devices.driver.Driver.read`; a cap at rest sends no reports, so every call gives a new reading.

        Raises
        ------
        DriverFault
            If the device is gone.
        """
        try:
            raw = self._handle.read(64)
            for _ in range(64):
                if not raw:
                    break
                self._decode_report(bytes(raw))
                raw = self._handle.read(64)
        except OSError:
            raise DriverFault(Fault.UNPLUGGED) from None
        now = self._clock()
        self._move_tip(0.0 if self._last_time is None else min(now - self._last_time, MAX_TIME_STEP))
        self._last_time = now
        pose = np.zeros(READING_SIZE)
        write_pose(pose, np.array(R_HP).T @ self._p_H, self._r_HS)
        reading[:] = pose
        self._reading_count += 1
        reading[READING_SWITCH] = float(self._buttons & 1)
        reading[READING_CLOCK] = now
        reading[READING_SEQUENCE] = self._reading_count
        return True

    @property
    def pushed(self) -> bool:
        """Whether the cap is deflected beyond the dead zone, or its first button pressed."""
        return bool(np.any(self._deflection != 0.0) or self._buttons & 1)

    @property
    def tip(self) -> Array:
        """Position of the tip in H [m], shape (3,)."""
        return self._p_H.copy()

    def start_at(self, p_H: Array) -> None:
        """Set the position of the tip in H [m], shape (3,)."""
        self._p_H = p_H.copy()

    def _decode_report(self, raw: bytes) -> None:
        """Decode a report; other kinds, such as the battery's, are ignored, and one that is too short is refused."""
        number, axes = raw[0], np.frombuffer(raw[1 : 1 + 2 * ((len(raw) - 1) // 2)], "<i2")
        if number == _TRANSLATION and len(axes) >= 6:
            self._deflection = _scaled_deflections(axes[:6])
        elif number == _TRANSLATION and len(axes) >= 3:
            self._deflection[:3] = _scaled_deflections(axes[:3])
        elif number == _ROTATION and len(axes) >= 3:
            self._deflection[3:] = _scaled_deflections(axes[:3])
        elif number == _BUTTONS and len(raw) >= 2:
            self._buttons = raw[1]
        else:
            self.telemetry[REFUSED] += number in (_TRANSLATION, _ROTATION, _BUTTONS)
            return
        self.telemetry[READ] += 1.0

    def _move_tip(self, seconds: float) -> None:
        step = MAX_SPEED * seconds * (_R_HC @ self._deflection[:3])
        for i in range(3):
            moved_tip = self._p_H.copy()
            moved_tip[i] += step[i]
            p_P = np.array(R_HP).T @ moved_tip
            if inside_workspace((p_P[0], p_P[1], p_P[2])):
                self._p_H = moved_tip
        turned = (
            Rotation.from_rotvec(MAX_ANGULAR_SPEED * seconds * (_R_HC @ self._deflection[3:])).as_matrix() @ self._r_HS
        )
        if self._is_within_gimbal_limits(turned):
            self._r_HS = turned

    def _is_within_gimbal_limits(self, r_HS: Array) -> bool:
        reading = np.zeros(READING_SIZE)
        write_pose(reading, np.array(R_HP).T @ self._p_H, r_HS)
        # Near the gimbal lock at a pitch of 90°, a small step would make the gimbal's angles jump.
        return abs(reading[READING_GIMBAL + 1]) < 1.4 and all(
            low <= angle <= high
            for angle, (low, high) in zip(reading[READING_GIMBAL:], PREMIUM_1_5.gimbal_limit, strict=True)
        )

    def write(self, torque: Array, enable: bool) -> None:
        """Do nothing: the device has no motors."""

    def let_go(self) -> None:
        """Do nothing: the device has no motors."""

    def close(self) -> None:
        """Close the device."""
        self._handle.close()


def _scaled_deflections(axes: npt.NDArray[np.int16]) -> Array:
    """Deflections relative to the full one, −1 … 1, and 0 within the dead zone."""
    deflection = np.clip(axes / FULL_DEFLECTION, -1.0, 1.0)
    return np.where(np.abs(deflection) < DEAD_ZONE, 0.0, deflection)
