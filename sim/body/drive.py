"""What follows the reference: a figure or a robot arm in the physics, a figure that is only shown, or nothing.

Chosen by type when the loop is compiled.
"""

from typing import Any, TypeAlias

from numba.extending import overload

from sim.body.figure_state import Array, FigureState
from sim.body.robot import RobotState, robot_torque
from sim.body.unsimulated import KinematicFigure, NoFigure
from sim.body.whole_body import figure_torque
from sim.reference.reference import update_reference
from sim.reference.reference_state import CompiledReference, NoReference

BodyState: TypeAlias = FigureState | RobotState | KinematicFigure | NoFigure
ReferenceState: TypeAlias = CompiledReference | NoReference


def drive(body: FigureState | RobotState, pose: Array, velocity: Array, acceleration: Array) -> None:
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


def follow(body: BodyState, reference: ReferenceState, argument: Array, trace: Array) -> None:
    """Update the reference at the map's argument (7,) and the field's trace, and what of a body follows it."""
    if isinstance(reference, CompiledReference):
        update_reference(reference, argument, trace)
        if isinstance(body, FigureState | RobotState):
            drive(body, reference.pose, reference.velocity, reference.acceleration)


def _follow_in_physics(body: Any, reference: Any, argument: Array, trace: Array) -> None:
    update_reference(reference, argument, trace)
    drive(body, reference.pose, reference.velocity, reference.acceleration)


def _show(body: Any, reference: Any, argument: Array, trace: Array) -> None:
    update_reference(reference, argument, trace)


def _stay_away(body: Any, reference: Any, argument: Array, trace: Array) -> None:
    pass


_FOLLOWS: dict[type, Any] = {
    FigureState: _follow_in_physics, RobotState: _follow_in_physics, KinematicFigure: _show, NoFigure: _stay_away,
}  # fmt: skip


@overload(follow, strict=False, inline="always")
def _follow(body: Any, reference: Any, argument: Any, trace: Any) -> Any:
    return _FOLLOWS[body.instance_class]
