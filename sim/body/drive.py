"""What follows the reference, the figure or a robot arm: the unit that sets its torques is chosen by its type."""

from collections.abc import Callable
from typing import Any, TypeAlias

from numba import typeof

from controllers.fields.instructions import VECTOR
from sim.body.figure_state import FigureState
from sim.body.robot import RobotState, robot_torque
from sim.body.whole_body import figure_torque
from sim.compilation.units import Unit

BodyState: TypeAlias = FigureState | RobotState

_DRIVES: dict[type, Callable[..., Any]] = {FigureState: figure_torque, RobotState: robot_torque}


def drive_unit(body: BodyState) -> Unit:
    """The unit that sets a body's torques for the reference of a control tick: pose, velocity, acceleration."""
    return Unit.of(_DRIVES[type(body)], typeof(body), VECTOR, VECTOR, VECTOR)
