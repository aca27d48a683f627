"""What follows the hand in a run: the body's control and its reference, by kind of body."""

from controllers.haptic_map.map_stages import CompiledMap
from experiments.fitting.figure_legs import packed_legs
from experiments.setups.parts.part_types import Parts, Settings
from models.world.scene import FIGURE
from sim.body.drive import BodyState, kinematic_figure, no_figure
from sim.body.figure import Figure
from sim.body.robot import robot_state
from sim.reference.reference import make_reference, no_reference
from sim.reference.reference_state import CompiledReference
from sim.world.world import World

_FEEDBACK_RATE = 60.0  # feedback rate of the robot arm's computed-torque control [1/s]


def figure_period(settings: Settings) -> float:
    """Time between two updates of the figure [s]."""
    return settings.clock.servo_period * settings.figure.figure_ticks


def body_of(parts: Parts, world: World, compiled: CompiledMap) -> tuple[BodyState, CompiledReference]:
    """Control and reference of the body in a world, which follows a compiled map."""
    config, period = parts.config.figure, figure_period(parts.config)
    if world.kind == "none":
        return no_figure(), no_reference()
    if world.kind == "robot":
        return robot_state(world, _FEEDBACK_RATE), make_reference(world.body, compiled, period, config.smoothing)
    reference = make_reference(
        world.body, compiled, period, config.smoothing, config.blend, packed_legs(world.body), parts.held_seconds,
        parts.cross_track,
    )  # fmt: skip
    if world.kind == "kinematic":
        return kinematic_figure(), reference
    gains = parts.gains._replace(force_bound=config.residual_force, moment_bound=config.residual_moment)
    return Figure(world.model, world.data, world.body, FIGURE, gains, period).state, reference
