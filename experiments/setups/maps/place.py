"""Place of a map of clips: its curve, and its domain about the curve."""

from typing import NamedTuple

from controllers.curves.cylinder import AXIS
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from experiments.config.maps import Composite, Cylindrical, MapFile, RiverClips
from experiments.setups.parts.pace import check_reach


class Place(NamedTuple):
    """The curve of a map of clips, and the map's domain about it.

    Attributes
    ----------
    curve : Trajectory
        A lap about the z axis, with the timing that the hand is to have.
    radius : float
        Radius of the middle of the domain [m].
    reach : float
        Half width of the domain in radius and in height [m].
    expressive : bool
        Whether the stylus's orientation turns the figure.
    """

    curve: Trajectory
    radius: float
    reach: float
    expressive: bool

    def radii(self) -> tuple[float, float]:
        """Ends of the domain in radius [m]; raises `ParameterError` if it reaches the axis, where phases meet."""
        if self.radius - self.reach <= AXIS:
            raise ParameterError(
                f"reach is {self.reach:g} m about a curve of radius {self.radius:.3g} m; expected less than "
                f"{max(self.radius - AXIS, 0.0):.3g} m, so that the map ends before the axis, or a larger radius"
            )
        return self.radius - self.reach, self.radius + self.reach


def place_of(part: Cylindrical | Composite | RiverClips | MapFile) -> Place:
    """The place of a configured map; raises `SimError` if the Phantom does not reach its curve."""
    around = part.around
    curve = check_reach(Trajectory.circle(around.radius, around.lap, wave=around.wave))
    return Place(curve, around.radius, part.reach, part.expressive)
