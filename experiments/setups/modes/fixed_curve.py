"""What modes along a curve that is not bent have in common: FOLLOW, the bunny and rivers."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.algebra.law import Law, Program
from controllers.fields.orientation import Orientation
from controllers.fields.soft_wall import SoftWall
from controllers.haptic_map.base import HapticMap
from controllers.safety.energy_tank import river_power
from controllers.safety.limiter import ForceLimiter
from controllers.state import stylus_path
from experiments.config.modes import Bunny, Follow, JointWalls, OrientationMoment, Rivers
from experiments.config.run_config import RunConfig
from experiments.results.measures.run_measures import trace_summary
from experiments.setups.parts.budget import tank_for
from experiments.setups.parts.hands import handling_spans, late_remark, resolved_user, turning_remark, user_hand
from experiments.setups.parts.part_types import ClipMapParts, Notes, Parts
from models.humanoid.skeleton import JOINTS, N_POSE, N_TANGENT, joint_range
from sim.users.hand.actions import Push

MOMENT_TUBE = 0.25  # [m] tube radius of the orientation moment where the field has no tube of its own


class FixedField(NamedTuple):
    """A field over a curve that is not bent.

    Attributes
    ----------
    law : Law
        Law of force, with the governor if there is one.
    course : Trajectory
        Curve along which it leads.
    power : float
        Largest power that its dampers inject [W].
    springs : sequence of (float, float)
        Stiffness [N/m] and reach [m] of each of its springs.
    notes : Notes
        Titles and labels.
    max_urged_speed : float
        Largest speed to which a governor urges the hand [m/s]; 0 without one.
    tube : float
        ε, radius of the tube in which the orientation moment acts [m].
    pushes : tuple of Push, optional
        Default pushes of a hand that pushes.
    other : Trajectory, optional
        Curve to which a person changes over; by default an enlarged one (`ChangeOver`).
    """

    law: Law
    course: Trajectory
    power: float
    springs: Sequence[tuple[float, float]]
    notes: Notes
    max_urged_speed: float = 0.0
    tube: float = MOMENT_TUBE
    pushes: tuple[Push, ...] | None = None
    other: Trajectory | None = None


def fixed_curve_parts(config: RunConfig, mode: Follow | Bunny | Rivers, maps: ClipMapParts, field: FixedField) -> Parts:
    """Parts of a run whose curve is not bent.

    Raises
    ------
    ControllerError
        If a number is out of its interval.
    """
    user = resolved_user(config.user, maps.curve, config.seconds, pushes=field.pushes)
    drag = 0.0 if mode.governor is None else mode.governor.governor_drag
    power, limiter = field.power + river_power(drag, field.max_urged_speed), ForceLimiter(config.clock.servo_period)
    traces = user.traces
    program = with_moment(field.law.program(), mode.orientation, field.course, field.tube)
    return Parts(
        config=replace(config, user=user), maps=maps, field=field.law, program=with_walls(program, mode.walls, maps),
        course=field.course, user=user_hand(user, maps.curve, config.seconds, config.seed, field.other),
        tank=tank_for(power, field.springs, maps.reach, limiter),
        notes=replace(field.notes, hand_does="traces") if traces else field.notes, gains=maps.gains,
        argument_at=lambda nearest, phases: stylus_path(nearest), handled=handling_spans(user),
        remarks=turning_remark(user, maps.oriented) + late_remark(user, config.seconds),
        summarise=lambda summary, of: replace(summary, trace=trace_summary(of.recording)) if traces else summary,
    )  # fmt: skip


def with_walls(program: Program, walls: JointWalls | None, maps: ClipMapParts) -> Program:
    """A field, plus the soft walls of the figure's joints if the run has them."""
    if walls is None:
        return program
    return program + figure_walls(maps.whole_map, walls).program()


def with_moment(program: Program, moment: OrientationMoment | None, course: Trajectory, tube: float) -> Program:
    """A field, plus the moment towards the curve's orientation if the run has one.

    Raises
    ------
    ParameterError
        If a gain of the moment is negative or not finite.
    """
    if moment is None or (moment.orientation_stiffness == 0.0 and moment.orientation_damping == 0.0):
        return program
    law = Orientation(course, moment.orientation_stiffness, moment.orientation_damping, tube)
    return program + law.program()


BRAKE_DAMPING = 2e-3  # damping of a joint that exceeds the greatest speed [N m s/rad]


def figure_walls(haptic_map: HapticMap, walls: JointWalls) -> SoftWall:
    """A field that repels the hand from the limits of the figure's joints and of their speeds.

    Raises
    ------
    ParameterError
        If a number is out of its interval.
    """
    margin, speed = walls.wall_margin, walls.joint_speed
    n, limits = len(JOINTS), joint_range()
    narrowest = float(np.diff(limits, axis=2).min())
    if margin > 0.5 * narrowest:
        raise ParameterError(
            f"--wall-margin is {margin:g} rad; expected at most {np.floor(500.0 * narrowest) / 1e3:g} rad, half of the "
            "narrowest range"
        )
    columns, rows = range(N_POSE - 4 * n, N_POSE, 4), range(N_TANGENT - 3 * n, N_TANGENT, 3)
    return SoftWall(
        haptic_map, tuple(columns), tuple(rows), tuple(limits), walls.wall_stiffness, margin, BRAKE_DAMPING, speed
    )
