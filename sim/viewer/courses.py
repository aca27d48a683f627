"""Curves of a run as they are drawn: its only curve, or every river in a colour of its own."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from geometry.arrays import Array
from sim.viewer.palette import CURVE, TUBE, river_colors


class Course(NamedTuple):
    """A curve as it is drawn.

    Attributes
    ----------
    name : str
        Name of the river; empty for a run's only curve.
    points : array (m, 3)
        Points in the hand frame [m].
    line, tube : str
        Colours of curve and tube, ``#rrggbb``.
    """

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
