"""Facts about a motion file that the user states in place of estimates."""

from dataclasses import dataclass
from pathlib import Path

from models.errors import ModelError
from models.mocap.retargeting.upright import AXES


@dataclass(frozen=True)
class Hints:
    """Facts about a file that the user states in place of estimates.

    Parameters
    ----------
    up : str or None
        The file's axis that points up, such as ``+Y``.
    rest_frame : int or None
        A frame of the file in which the body stands upright with level feet, counted from 0.
    roles : Path or None
        A file that assigns roles to joints, in place of the joints' names; see `role_file`.
    frame_rate : float or None
        Frames per second [1/s]; for frames of unequal durations (DeepMimic) the rate of the shortest.

    Raises
    ------
    ModelError
        If there is no such axis, the frame is negative, or the rate is not between 0.1 and 10000 a second.
    """

    up: str | None = None
    rest_frame: int | None = None
    roles: Path | None = None
    frame_rate: float | None = None

    def __post_init__(self) -> None:
        if self.up is not None and self.up not in AXES:
            raise ModelError(f"no axis {self.up!r}; expected one of {', '.join(AXES)}")
        if self.rest_frame is not None and self.rest_frame < 0:
            raise ModelError(f"rest frame is {self.rest_frame}; expected a frame of the file, counted from 0")
        if self.frame_rate is not None and not 0.1 <= self.frame_rate <= 1e4:
            raise ModelError(f"frame rate is {self.frame_rate:g} a second; expected 0.1 to 10000, such as 60")

    def of_estimates(self) -> tuple[str, ...]:
        """Stated command-line options that replace an estimate; the frame rate is never estimated."""
        stated = {"--up": self.up, "--rest-frame": self.rest_frame, "--roles": self.roles}
        return tuple(option for option, value in stated.items() if value is not None)
