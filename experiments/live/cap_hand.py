"""A SpaceMouse as the hand: while its cap is pushed the hand holds the stylus; its first button is the switch."""

import time

import numpy as np

from geometry.arrays import Array
from sim.devices.exchange import READING_SIZE, READING_SWITCH
from sim.devices.hardware_list import list_devices, open_hid
from sim.devices.spacemouse import SpaceMouse
from sim.errors import SimError

RELEASE_DELAY = 0.3  # [s] without a push of the cap, after which the hand releases the stylus


class CapHand:
    """A hand that is moved by the cap of a SpaceMouse.

    Parameters
    ----------
    mouse : SpaceMouse
        An open device, which this object owns and closes.
    """

    def __init__(self, mouse: SpaceMouse):
        self._mouse, self._reading = mouse, np.zeros(READING_SIZE)
        self._last_push_time = -np.inf
        self.holds = False

    def wish(self, stylus: Array) -> tuple[Array, bool] | None:
        """Target position of the stylus in H [m], and whether its switch is pressed; None if the hand does not hold it.

        Parameters
        ----------
        stylus : Array
            Position of the stylus in H [m], shape (3,); the hand starts there when it grasps the stylus.

        Raises
        ------
        DriverFault
            If the device was disconnected.
        """
        if not self.holds:
            self._mouse.start_at(stylus)
        self._mouse.read(self._reading, 0.0)
        now = time.monotonic()
        if self._mouse.pushed:
            self._last_push_time = now
        self.holds = now - self._last_push_time < RELEASE_DELAY
        return (self._mouse.tip, bool(self._reading[READING_SWITCH])) if self.holds else None

    def close(self) -> None:
        """Close the device."""
        self._mouse.close()


def open_cap_hand() -> tuple[CapHand | None, str]:
    """The first SpaceMouse of this machine, opened, or None; and a message for the user, which may be empty."""
    try:
        found = next((device for device in list_devices() if device.kind == "spacemouse"), None)
        if found is None:
            return None, ""
        return CapHand(SpaceMouse(open_hid(found.path), found.product, found.path)), f"{found.product} moves the hand."
    except SimError as error:
        return None, str(error)
