"""What a simulated user means to do with the stylus: nothing, trace a path of their own, push at a place and a time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim.errors import SimError

Array = npt.NDArray[np.float64]

PUSH_COLUMNS = 11
"""A push as a row: start, duration, peak, direction (3), outward, place (3), radius. A radius of 0 means any place."""


@dataclass(frozen=True)
class Push:
    r"""A push of the hand: a smooth bump of force in one direction.

    .. math:: F(t) = F_{max} \sin^2(\pi (t - t_0) / T)\, d, \qquad t_0 \le t \le t_0 + T

    Parameters
    ----------
    start : float
        Earliest time [s].
    duration : float
        T [s].
    peak : float
        Largest force [N]; negative pushes the other way.
    direction : tuple of float, optional
        Fixed direction d in the hand frame, any length but zero. By default away from the vertical axis of the hand
        frame, wherever the hand is.
    place : tuple of float, optional
        Where in the hand frame [m]: the push begins when the hand first comes within `radius` of it after `start`.
    radius : float
        [m]

    Raises
    ------
    SimError
        If a number is out of its interval or the direction has no length.
    """

    start: float
    duration: float
    peak: float
    direction: tuple[float, float, float] | None = None
    place: tuple[float, float, float] | None = None
    radius: float = 0.01

    def __post_init__(self) -> None:
        numbers = [self.start, self.duration, self.peak, self.radius, *(self.direction or ()), *(self.place or ())]
        if not np.all(np.isfinite(numbers)):
            raise SimError(f"a push has a number that is not finite: {self}")
        if self.duration <= 0.0 or self.start < 0.0 or self.radius <= 0.0:
            raise SimError(f"a push needs start ≥ 0 s, duration > 0 s and radius > 0 m, got {self}")
        if self.direction is not None and np.linalg.norm(self.direction) < 1e-12:
            raise SimError(f"the direction of a push has no length: {self.direction}")

    def row(self) -> Array:
        """The push as numbers for the compiled hand, shape (11,)."""
        direction = np.zeros(3) if self.direction is None else np.array(self.direction) / np.linalg.norm(self.direction)
        place, radius = (np.zeros(3), 0.0) if self.place is None else (np.array(self.place), self.radius)
        outward = float(self.direction is None)
        return np.array([self.start, self.duration, self.peak, *direction, outward, *place, radius])


def push_table(pushes: Sequence[Push]) -> Array:
    """Rows of all pushes, shape (n, 11)."""
    return np.array([push.row() for push in pushes]).reshape(len(pushes), PUSH_COLUMNS)
