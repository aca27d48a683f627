"""A recorded hand behind the device protocol: it moves as it did, whatever force it is given."""

from typing import Self

from controllers.state import HandState, Vec3
from sim.devices.base import DeviceError, checked_force
from sim.recording.recording import Recording


class ReplayDevice:
    """The hand of a recording, tick by tick.

    Parameters
    ----------
    recording : Recording
        With the channels of `sim.loop.loop.groups`; stays open while the device is used.

    Raises
    ------
    DeviceError
        If the recording holds no tick.
    """

    def __init__(self, recording: Recording):
        self._ticks = recording.groups["ticks"]
        self._length = len(self._ticks["t"])
        if self._length == 0:
            raise DeviceError("the recording holds no tick; there is no hand to replay")
        self._period = 1.0 / recording.rates["ticks"]
        self._tick = 0
        self._open = True

    @property
    def period(self) -> float:
        """Servo period of the recording [s]."""
        return self._period

    def read(self) -> HandState:
        """See `sim.devices.base.Device`."""
        self._check_open()
        if self._tick >= self._length:
            raise DeviceError(f"the recording ends after {self._length} ticks ({self._length * self._period:g} s)")
        row, k = self._ticks, self._tick
        pressed = bool(row["switch"][k])
        return HandState(float(row["t"][k]), row["p"][k], row["quaternion"][k], row["v"][k], row["omega"][k], pressed)

    def write(self, force: Vec3) -> None:
        """See `sim.devices.base.Device`; the force is checked and has no effect."""
        self._check_open()
        checked_force(force)
        self._tick += 1

    def close(self) -> None:
        """See `sim.devices.base.Device`."""
        self._open = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _check_open(self) -> None:
        if not self._open:
            raise DeviceError("the replayed device is closed; make a new one")
