"""A moment of a run that is displayed, and simulated time kept in step with the clock of a person who watches."""

import time
from typing import NamedTuple

from controllers.state import Array


class Moment(NamedTuple):
    """The displayed state of a run at one time.

    Attributes
    ----------
    t : float
        Time [s].
    qpos : Array
        Configuration of the world, with the figure.
    ghost : Array
        Pose of the ghost, shape (75,); empty if there is none.
    p, force, user : Array
        Stylus tip [m], force of the device and force of the hand [N], in H, shape (3,) each.
    target : Array
        Intended position of the hand in H [m], shape (3,); NaN if the hand has let go.
    """

    t: float
    qpos: Array
    ghost: Array
    p: Array
    force: Array
    user: Array
    target: Array


class RealTime:
    """Sleeps until the wall clock has caught up with the simulated time.

    The clock starts with the first wait. A simulation that is late is not made to catch up: the origin of the wall
    clock is moved instead.
    """

    def __init__(self) -> None:
        self._origin: float | None = None

    def wait_until(self, t: float) -> None:
        """Sleep until the wall clock reaches simulated time t [s]."""
        now = time.monotonic()
        if self._origin is None or now - self._origin > t:
            self._origin = now - t
        else:
            time.sleep(self._origin + t - now)
