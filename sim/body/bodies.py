"""The body of a run, by how its world has the figure."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from models.scene import FIGURE
from sim.body.figure import Figure, FigureGains
from sim.body.unsimulated import KinematicFigure, NoFigure, kinematic_figure, no_figure
from sim.world.world import World


@dataclass(frozen=True)
class UnsimulatedFigure:
    """A figure that is not in the physics.

    Parameters
    ----------
    state : KinematicFigure or NoFigure
        For the servo.
    weight : float
        What it would weigh [N].
    """

    state: KinematicFigure | NoFigure
    weight: float


Body: TypeAlias = Figure | UnsimulatedFigure


def make_body(world: World, gains: FigureGains = FigureGains()) -> Body:  # noqa: B008 - immutable
    """What a servo drives: its `state`, and the `weight` that forces are compared with.

    Parameters
    ----------
    world : World
        Which says by its `kind` what there is; must outlive the body.
    gains : FigureGains
        Of a physical figure.
    """
    if world.kind == "physical":
        return Figure(world.model, world.data, world.figure, FIGURE, gains)
    weight = float(np.sum(world.figure.body_mass)) * float(np.linalg.norm(world.figure.opt.gravity))
    return UnsimulatedFigure(kinematic_figure() if world.kind == "kinematic" else no_figure(), weight)
