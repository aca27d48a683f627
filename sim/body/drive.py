"""Dispatch by body type: a figure or a robot arm in the physics, a figure that is only shown, or no body.

The body's type selects the compilation unit that sets the torques, and whether the reference is updated at all.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numba import typeof
from numba.extending import overload

from controllers.fields.algebra.instructions import VECTOR
from controllers.kernel_call import call_as_given
from controllers.lent import Lent, by_pointer
from geometry.arrays import Array, IntArray
from sim.body.figure_state import REPORT_SIZE, FigureState
from sim.body.robot import RobotState, robot_torque
from sim.body.whole_body import figure_torque
from sim.compilation.units import Unit
from sim.errors import SimError
from sim.reference.reference import update_unit
from sim.reference.reference_state import CompiledReference


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


BodyState: TypeAlias = FigureState | RobotState | KinematicFigure | NoFigure

_TORQUE_FUNCTIONS: dict[type, Callable[..., Any]] = {FigureState: figure_torque, RobotState: robot_torque}


def drive_unit(body: FigureState | RobotState) -> Unit:
    """The unit that sets a body's torques for the reference pose, velocity and acceleration of a control tick."""
    return Unit.of(_TORQUE_FUNCTIONS[type(body)], Lent(typeof(body)), VECTOR, VECTOR, VECTOR)


def follow_units(body: BodyState, reference: CompiledReference) -> tuple[Unit, ...]:
    """Units that `follow` calls by address: the reference's, then the body's; only those that the body type needs."""
    if isinstance(body, NoFigure):
        return ()
    driven = (drive_unit(body),) if isinstance(body, FigureState | RobotState) else ()
    return update_unit(reference), *driven


def follow_addresses(body: BodyState, reference: CompiledReference) -> IntArray:
    """Addresses of `follow_units`, 0 for one that is not needed, shape (2,); compiles those not in the cache."""
    addresses = np.zeros(2, dtype=np.int64)
    for i, unit in enumerate(follow_units(body, reference)):
        addresses[i] = unit.address()
    return addresses


def follow(units: IntArray, body: BodyState, reference: CompiledReference, argument: Array, trace: Array) -> None:
    """Update the reference, and set the torques of the body that tracks it. For compiled code only.

    `units` are `follow_addresses`, `argument` (7,) is the stylus pose at which the map is evaluated, `trace` the trace
    of the field.
    """
    raise NotImplementedError("compiled code only")


def _update_and_drive(units: IntArray, body: Any, reference: CompiledReference, argument: Array, trace: Array) -> None:
    if units[0] == 0 or units[1] == 0:
        raise SimError("what updates and drives the figure is not compiled; take the servo's `linked`")
    call_as_given(units[0], (by_pointer(reference), argument, trace))
    call_as_given(units[1], (by_pointer(body), reference.pose, reference.velocity, reference.acceleration))


def _update_reference(units: IntArray, body: Any, reference: CompiledReference, argument: Array, trace: Array) -> None:
    if units[0] == 0:
        raise SimError("what updates the figure is not compiled; take the servo's `linked`")
    call_as_given(units[0], (by_pointer(reference), argument, trace))


def _do_nothing(units: IntArray, body: Any, reference: CompiledReference, argument: Array, trace: Array) -> None:
    pass


_FOLLOW_BY_TYPE: dict[type, Any] = {
    FigureState: _update_and_drive, RobotState: _update_and_drive, KinematicFigure: _update_reference,
    NoFigure: _do_nothing,
}  # fmt: skip


@overload(follow, strict=False)
def _select_follow(units: Any, body: Any, reference: Any, argument: Any, trace: Any) -> Any:
    return _FOLLOW_BY_TYPE[body.instance_class]
