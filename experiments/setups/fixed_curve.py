"""What modes whose curve stays have in common: the hand on it, and the moment, governor and walls that are added."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from controllers.curves.trajectory import Trajectory
from controllers.fields.law import Law, Program
from controllers.fields.orientation import Orientation
from controllers.safety.energy_tank import river_power
from controllers.safety.limiter import ForceLimiter
from experiments.config.modes import Bunny, Follow, JointWalls, OrientationMoment, Rivers
from experiments.config.run_config import RunConfig
from experiments.results.measures import trace_summary
from experiments.results.summary import RunSummary
from experiments.setups.budget import tank_for
from experiments.setups.hands import handled, resolved_user, turning_remark, user_hand
from experiments.setups.parts import ClipMapParts, Measuring, Notes, Parts
from experiments.setups.stylus import stylus_path
from experiments.setups.walls import figure_walls
from sim.users.intent import Push

TUBE = 0.25  # [m] within which a moment turns the stylus, where the field has no tube of its own


class FixedField(NamedTuple):
    """A field over a curve that stays.

    Attributes
    ----------
    law : Law
        Law of force, governed if it is.
    course : Trajectory
        Along which it leads.
    power : float
        What its dampers inject [W].
    springs : sequence of (float, float)
        Stiffness [N/m] and reach [m] of what it holds.
    notes : Notes
        What is said of it.
    urged : float
        Speed to which a governor urges the hand [m/s].
    tube : float
        ε, in which the moment turns the stylus [m].
    pushes : tuple of Push, optional
        Default of a hand that pushes.
    """

    law: Law
    course: Trajectory
    power: float
    springs: Sequence[tuple[float, float]]
    notes: Notes
    urged: float = 0.0
    tube: float = TUBE
    pushes: tuple[Push, ...] | None = None


def fixed_curve_parts(config: RunConfig, mode: Follow | Bunny | Rivers, maps: ClipMapParts, field: FixedField) -> Parts:
    """Parts of a run whose curve stays.

    Raises
    ------
    ControllerError
        If a number is out of its interval.
    """
    user = resolved_user(config.user, maps.curve, config.seconds, pushes=field.pushes)
    drag = 0.0 if mode.governor is None else mode.governor.governor_drag
    power, limiter = field.power + river_power(drag, field.urged), ForceLimiter(config.clock.servo_period)
    traces = user.traces
    program = with_moment(field.law.program(), mode.orientation, field.course, field.tube)
    return Parts(
        config=replace(config, user=user), maps=maps, field=field.law, program=with_walls(program, mode.walls, maps),
        course=field.course, user=user_hand(user, maps.curve, config.seconds, config.seed),
        tank=tank_for(power, field.springs, maps.reach, limiter),
        notes=replace(field.notes, hand_does="traces") if traces else field.notes, gains=maps.gains,
        argument_at=lambda nearest, phases: stylus_path(nearest), handled=handled(user),
        remarks=turning_remark(user, maps.expressive), summarise=_traced if traces else lambda summary, of: summary,
    )  # fmt: skip


def _traced(summary: RunSummary, of: Measuring) -> RunSummary:
    return replace(summary, trace=trace_summary(of.recording))


def with_walls(program: Program, walls: JointWalls | None, maps: ClipMapParts) -> Program:
    """A field, and the walls of the figure's joints if the run has them."""
    if walls is None:
        return program
    made = figure_walls(maps.whole_map, walls.wall_stiffness, walls.wall_margin, walls.joint_speed)
    return program + made.program()


def with_moment(program: Program, moment: OrientationMoment | None, course: Trajectory, tube: float) -> Program:
    """A field, and the moment to the curve's orientation if the run has one.

    Raises
    ------
    ParameterError
        If a gain of the moment is negative or not finite.
    """
    if moment is None or (moment.orientation_stiffness == 0.0 and moment.orientation_damping == 0.0):
        return program
    law = Orientation(course, moment.orientation_stiffness, moment.orientation_damping, tube)
    return program + law.program()
