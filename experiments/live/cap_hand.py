"""The hand on a SpaceMouse: while its cap is pushed the hand has the stylus, and its first button is the switch."""

import time

import numpy as np

from controllers.state import Array
from sim.devices.exchange import READING_SIZE, READING_SWITCH
from sim.devices.hardware_list import found_devices, open_hid
from sim.devices.spacemouse import SpaceMouse
from sim.errors import SimError

RESTS = 0.3  # [s] after which a cap that nobody pushes has let go


class CapHand:
    """A cap that moves the hand.

    Parameters
    ----------
    mouse : SpaceMouse
        Open; owned from here on.
    """

    def __init__(self, mouse: SpaceMouse):
        self._mouse, self._reading = mouse, np.zeros(READING_SIZE)
        self._pushed = -np.inf
        self.holds = False

    def wish(self, stylus: Array) -> tuple[Array, bool] | None:
        """Where the hand means to have the stylus, in H [m], and whether its switch is pressed; None if it rests.

        Parameters
        ----------
        stylus : Array
            Where the stylus is, in H [m], shape (3,): there a hand begins that takes it.

        Raises
        ------
        DriverFault
            If the device is gone.
        """
        if not self.holds:
            self._mouse.start_at(stylus)
        self._mouse.read(self._reading, 0.0)
        now = time.monotonic()
        if self._mouse.pushed:
            self._pushed = now
        self.holds = now - self._pushed < RESTS
        return (self._mouse.tip, bool(self._reading[READING_SWITCH])) if self.holds else None

    def close(self) -> None:
        """Give the device back."""
        self._mouse.close()


def cap_there() -> tuple[CapHand | None, str]:
    """The first SpaceMouse that this machine has and this user may open, and what is to be said."""
    try:
        found = next((device for device in found_devices() if device.kind == "spacemouse"), None)
        if found is None:
            return None, ""
        return CapHand(SpaceMouse(open_hid(found.path), found.product, found.path)), f"{found.product} moves the hand."
    except SimError as error:
        return None, str(error)
