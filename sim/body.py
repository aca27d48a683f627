"""What follows the reference, the figure or a robot arm: its control is chosen by type when the loop is compiled."""

from typing import Any, TypeAlias

from numba.extending import overload

from sim.figure_state import Array, FigureState
from sim.robot import RobotState, robot_torque
from sim.whole_body import figure_torque

BodyState: TypeAlias = FigureState | RobotState


def drive(body: BodyState, pose: Array, velocity: Array, acceleration: Array) -> None:
    """Set a body's torques for the reference of this control tick; arguments as in `sim.figure` and `sim.robot`."""
    if isinstance(body, FigureState):
        figure_torque(body, pose, velocity, acceleration)
    else:
        robot_torque(body, pose, velocity, acceleration)


@overload(drive, strict=False)
def _drive(body: Any, pose: Any, velocity: Any, acceleration: Any) -> Any:
    def drive_figure(body: FigureState, pose: Array, velocity: Array, acceleration: Array) -> None:
        figure_torque(body, pose, velocity, acceleration)

    def drive_robot(body: RobotState, pose: Array, velocity: Array, acceleration: Array) -> None:
        robot_torque(body, pose, velocity, acceleration)

    return {FigureState: drive_figure, RobotState: drive_robot}[body.instance_class]
