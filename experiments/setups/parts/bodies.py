"""What follows the hand in a run: the body's control and its reference, by kind of body."""

from controllers.haptic_map.map_stages import CompiledMap
from experiments.fitting.figure_legs import packed_legs
from experiments.setups.parts.part_types import Parts, Settings
from models.world.scene import FIGURE
from sim.body.drive import BodyState
from sim.body.figure import Figure
from sim.body.robot import robot_state
from sim.body.unsimulated import kinematic_figure, no_figure
from sim.reference.reference import make_reference, no_reference
from sim.reference.reference_state import CompiledReference
from sim.world.world import World

_FEEDBACK_RATE = 60.0  # feedback rate of the robot arm's computed-torque control [1/s]


def body_of(parts: Parts, world: World, compiled: CompiledMap) -> tuple[BodyState, CompiledReference]:
    """Control and reference of the body in a world, which follows a compiled map."""
    return _BODIES[world.kind](parts, world, compiled)


def figure_period(settings: Settings) -> float:
    """Time between two updates of the figure [s]."""
    return settings.clock.servo_period * settings.figure.figure_ticks


def _reference(parts: Parts, world: World, compiled: CompiledMap) -> CompiledReference:
    figure = parts.config.figure
    return make_reference(
        world.body, compiled, figure_period(parts.config), figure.smoothing, figure.blend, packed_legs(world.body),
        parts.held_seconds,
    )  # fmt: skip


def _physical_body(parts: Parts, world: World, compiled: CompiledMap) -> tuple[BodyState, CompiledReference]:
    bounds = parts.config.figure
    gains = parts.gains._replace(force_bound=bounds.residual_force, moment_bound=bounds.residual_moment)
    figure = Figure(world.model, world.data, world.body, FIGURE, gains, figure_period(parts.config))
    return figure.state, _reference(parts, world, compiled)


def _kinematic_body(parts: Parts, world: World, compiled: CompiledMap) -> tuple[BodyState, CompiledReference]:
    return kinematic_figure(), _reference(parts, world, compiled)


def _no_body(parts: Parts, world: World, compiled: CompiledMap) -> tuple[BodyState, CompiledReference]:
    return no_figure(), no_reference()


def _robot_body(parts: Parts, world: World, compiled: CompiledMap) -> tuple[BodyState, CompiledReference]:
    smoothing = parts.config.figure.smoothing
    reference = make_reference(world.body, compiled, figure_period(parts.config), smoothing)
    return robot_state(world, _FEEDBACK_RATE), reference


_BODIES = {"physical": _physical_body, "kinematic": _kinematic_body, "none": _no_body, "robot": _robot_body}
