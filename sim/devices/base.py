"""What a force-feedback device is to the loop: something that tells where the hand is and takes a force."""

from typing import Protocol, Self

import numpy as np

from controllers.state import HandState, Vec3
from sim.errors import SimError


class DeviceError(SimError):
    """A device that is closed, has gone, has no more to tell, or was asked for what it cannot do."""


class Device(Protocol):
    """A device with a stylus: simulated, replayed or real.

    The loop calls `read`, then `write`, once per period. A device is a context manager; leaving it lets go of the hand.
    """

    @property
    def period(self) -> float:
        """Time between two reads [s]."""
        ...

    def read(self) -> HandState:
        """The state of the hand as the sensors tell it, in the hand frame; the same until the next write.

        Raises
        ------
        DeviceError
            If the device is closed, has gone, or has no more to tell.
        """
        ...

    def write(self, force: Vec3) -> None:
        """Command a force on the hand [N], in the hand frame, for one period.

        Raises
        ------
        DeviceError
            If the device is closed or has gone, or the force is not three finite numbers.
        """
        ...

    def close(self) -> None:
        """Command no force and let go of the device; closing twice is allowed."""
        ...

    def __enter__(self) -> Self:
        """Use as a context manager."""
        ...

    def __exit__(self, *error: object) -> None:
        """Close."""
        ...


def checked_force(force: Vec3) -> Vec3:
    """A force as an array of three finite numbers.

    Raises
    ------
    DeviceError
        If it is not.
    """
    array = np.asarray(force, dtype=np.float64)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise DeviceError(f"a force must be three finite numbers [N], got {force!r}")
    return array
