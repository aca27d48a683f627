"""The curves that are drawn of a run: the one that it has, or every river in a colour of its own."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controllers.state import Array
from sim.viewer.palette import CURVE, TUBE, river_colors


class Course(NamedTuple):
    """A curve as it is drawn.

    Attributes
    ----------
    name : str
        Of the river; of a run's only curve, none.
    points : array (m, 3)
        In the hand frame [m].
    line, tube : str
        Colours, ``#rrggbb``.
    """

    name: str
    points: Array
    line: str
    tube: str


def courses(static: Mapping[str, npt.ArrayLike | str]) -> tuple[Course, ...]:
    """What is drawn of a recording's arrays and texts: ``curve``, or ``river_curves`` by their ``river_names``."""
    if "river_curves" not in static:
        return (Course("", np.asarray(static["curve"], dtype=np.float64), CURVE, TUBE),)
    names, curves = str(static["river_names"]).split("\n"), np.asarray(static["river_curves"], dtype=np.float64)
    drawn = zip(names, curves, river_colors(len(names)), strict=True)
    return tuple(Course(name, points, color, color) for name, points, color in drawn)
