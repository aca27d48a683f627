"""Figures that are not in the physics: one that only shows the animation, and none at all."""

from typing import NamedTuple

import numpy as np

from controllers.state import Array
from sim.body.figure_state import REPORT_SIZE


class KinematicFigure(NamedTuple):
    """A figure that is where the map has it: h(p) is evaluated and recorded, and nothing follows it.

    Attributes
    ----------
    applied, report : Array
        As of the physical figure, always zero: no residual wrench (6,), nothing to report (10,).
    """

    applied: Array
    report: Array


class NoFigure(NamedTuple):
    """The device alone: the map is not evaluated. The attributes are those of `KinematicFigure`."""

    applied: Array
    report: Array


def kinematic_figure() -> KinematicFigure:
    """What a servo holds for a figure that is only shown."""
    return KinematicFigure(np.zeros(6), np.zeros(REPORT_SIZE))


def no_figure() -> NoFigure:
    """What a servo holds where there is no figure."""
    return NoFigure(np.zeros(6), np.zeros(REPORT_SIZE))
