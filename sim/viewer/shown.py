"""What is displayed of a run: its curves, and a moment of it; time kept in step with the wall clock."""

import time
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from geometry.arrays import Array
from sim.viewer.palette import CURVE, TUBE, river_colors

COURSE_POINTS = 241  # points at which a curve is drawn


class Course(NamedTuple):
    """A curve as it is drawn: name of the river or empty, points (m, 3) in H [m], colours ``#rrggbb``."""

    name: str
    points: Array
    line: str
    tube: str


def courses(static: Mapping[str, npt.ArrayLike | str]) -> tuple[Course, ...]:
    """The curves in a recording's arrays and texts: ``curve``, or ``river_curves`` with their ``river_names``."""
    if "river_curves" not in static:
        return (Course("", np.asarray(static["curve"], dtype=np.float64), CURVE, TUBE),)
    names, curves = str(static["river_names"]).split("\n"), np.asarray(static["river_curves"], dtype=np.float64)
    drawn = zip(names, curves, river_colors(len(names)), strict=True)
    return tuple(Course(name, points, color, color) for name, points, color in drawn)


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
