"""Bodies outside the physics: a kinematic figure that only shows the animation, and no figure at all."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import Array
from sim.body.figure_state import REPORT_SIZE


class KinematicFigure(NamedTuple):
    """A figure shown in the reference pose: the haptic map is evaluated and recorded, and no body tracks it.

    Attributes
    ----------
    applied, report : Array
        Residual wrench (6,) and report (10,) as of the physical figure, always zero.
    """

    applied: Array
    report: Array


class NoFigure(NamedTuple):
    """The device alone: the map is not evaluated. The attributes are those of `KinematicFigure`."""

    applied: Array
    report: Array


def kinematic_figure() -> KinematicFigure:
    """A servo's body for a figure that is only shown."""
    return KinematicFigure(np.zeros(6), np.zeros(REPORT_SIZE))


def no_figure() -> NoFigure:
    """A servo's body where there is no figure."""
    return NoFigure(np.zeros(6), np.zeros(REPORT_SIZE))
