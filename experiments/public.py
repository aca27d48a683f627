"""Small makers of the public face: clips by name or from files, the default curve, the version."""

from importlib.metadata import version as installed
from pathlib import Path

from controllers.curves.trajectory import Trajectory
from models.mocap.clip import Clip
from models.mocap.library import embedded, embedded_names, load_clip


def clips(*names: str) -> tuple[Clip, ...]:
    """Embedded clips by name; all of them without any.

    Raises
    ------
    ModelError
        If there is no clip of a name.
    """
    return tuple(embedded(name) for name in names or embedded_names())


def load(path: str | Path) -> Clip:
    """The motion in a BVH, AMC or DeepMimic file, on the figure.

    Raises
    ------
    ModelError
        If the file cannot be read, or its skeleton is not a human's.
    """
    return load_clip(Path(path))


def circle(radius: float = 0.0477, lap: float = 4.0) -> Trajectory:
    """A circle about the vertical axis of the hand frame, of a radius [m] and run through in so long [s]."""
    return Trajectory.circle(radius, lap)


def version() -> str:
    """Of the installed package."""
    return installed("haptic-vector-fields")
