"""Small factory functions of the public interface: clips by name or from files, the default curve, the version."""

import warnings
from importlib.metadata import version as installed
from pathlib import Path

from controllers.checks import check_kind, checked
from controllers.curves.trajectory import Trajectory
from experiments.config.keywords import to_keywords, with_keyword_messages
from experiments.config.maps import Circle
from experiments.files.given_path import given_path
from experiments.lifting.lift_report import lift_into
from experiments.preparation.command import prepare_file
from experiments.preparation.prepared_clip import prepared_clips
from models.mocap.library import embedded, embedded_names
from models.mocap.motion.clip import Clip


def clips(*names: str | Path) -> tuple[Clip, ...]:
    """Embedded clips by name, and motions in files as by `load`; all embedded clips if no name is given.

    Raises
    ------
    ModelError
        If there is no clip of that name, or a file cannot be read.
    ParameterError
        If a name is neither text nor a path.
    """
    for name in names:
        check_kind("name", name, str | Path)
    return tuple(load(name) if Path(name).suffix else embedded(str(name)) for name in names or embedded_names())


@with_keyword_messages()
def load(path: str | Path, raw: bool = False) -> Clip:
    """The motion in a BVH, AMC or DeepMimic file on the figure, prepared once as by ``hvf prepare``.

    A prepared file, on the figure's own skeleton and closed or at rest at both ends, is taken as it is. Warns if no
    motion near the capture is feasible on contact.

    Parameters
    ----------
    path : path
        The file.
    raw : bool
        Take the capture as it is, not prepared.

    Raises
    ------
    ModelError
        If the file cannot be read, or its skeleton is not a human's.
    """
    check_kind("raw", raw, bool)
    found = prepared_clips([given_path("path", path)], raw)[0]
    if not found.feasible:
        warnings.warn(to_keywords(found.remarks[-1]), stacklevel=3)
    return found.clip


lift = with_keyword_messages()(lift_into)
prepare = with_keyword_messages()(prepare_file)


def circle(radius: float = 0.0477, lap: float = 4.0) -> Trajectory:
    """A circle about the vertical axis of the hand frame H, with its radius [m] and the duration of a lap [s].

    Raises
    ------
    ControllerError
        If one of them is no number, the radius not positive and finite, or the lap not between 0.1 s and a day.
    """
    around = Circle(radius=radius, lap=checked("lap", lap, "s"))
    return Trajectory.circle(around.radius, lap)


def version() -> str:
    """Version of the installed package."""
    return installed("haptic-vector-fields")
