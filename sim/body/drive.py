"""What follows the reference, the figure or a robot arm: its control is chosen by type when the loop is compiled."""

from typing import Any, TypeAlias

from numba.extending import overload

from sim.body.figure_state import Array, FigureState
from sim.body.robot import RobotState, robot_torque
from sim.body.whole_body import figure_torque

BodyState: TypeAlias = FigureState | RobotState


def drive(body: BodyState, pose: Array, velocity: Array, acceleration: Array) -> None:
    """Set a body's torques for the reference of this control tick; as in `sim.body.figure`, `sim.body.robot`."""
    if isinstance(body, FigureState):
        figure_torque(body, pose, velocity, acceleration)
    else:
        robot_torque(body, pose, velocity, acceleration)


# A function around them would take all the arrays of a state once more, number by number.
_DRIVES: dict[type, Any] = {FigureState: figure_torque, RobotState: robot_torque}


@overload(drive, strict=False)
def _drive(body: Any, pose: Any, velocity: Any, acceleration: Any) -> Any:
    return _DRIVES[body.instance_class].py_func
