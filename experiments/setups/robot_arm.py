"""Runs with a seven-joint robot arm in place of the figure: the same field and the same loop."""

from collections.abc import Callable

import mujoco
import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.follow import Follow
from controllers.haptic_map.base import CompiledMap
from controllers.haptic_map.robot_arm import ROBOT_ARM, RobotArm
from controllers.safety.energy_tank import river_power
from controllers.safety.limiter import ForceLimiter
from controllers.state import STYLUS_POSE, Array
from experiments.config.run_config import ArmConfig
from experiments.setups.parts.budget import fastest, tank_for
from experiments.setups.parts.hands import lap_pushes
from experiments.setups.parts.pace import reached
from models.robot_arm.spec import ARM_JOINTS, arm_lengths, arm_limits, arm_model
from models.world.scene import PHANTOM
from sim.body.robot import robot_state
from sim.compilation.units import Unit
from sim.devices.simulated import simulated_phantom
from sim.loop.run_units import run_units
from sim.loop.servo import Servo, unlinked_field
from sim.reference.reference import check_reference, make_reference, poses_along
from sim.users.hand.arm import Arm
from sim.world.phantom_port import phantom_port
from sim.world.plant import make_plant
from sim.world.robot_world import RobotWorld

HOME = np.array([0.7, 0.0, 0.4])  # home position of the tool (end effector) in the frame of the arm's base [m]
TILT = np.radians(75.0)  # tilt of the tool from the vertical
ORIENTATION = np.array([np.cos(0.5 * TILT), 0.0, np.sin(0.5 * TILT), 0.0])
SCALE = 1.5  # ratio of the tool's motion to the stylus's: it stays in a ball of 1.5 times the second reach, 15 cm
REACH = (0.07, 0.1)  # [m] stylus distance up to which the tool follows exactly, and its bound in saturation
TURN = (np.radians(15.0), np.radians(25.0))  # [rad] the same of the stylus's rotation
ARM_ANGLE = np.radians(30.0)  # ψ of `RobotArm` [rad]
RATE = 60.0  # feedback rate of the arm's computed-torque control [1/s]


def robot_arm_map() -> RobotArm:
    """The default map: the tool follows the stylus in front of the arm, with displacements scaled by 1.5."""
    arm = arm_model()
    return RobotArm(
        arm_lengths(arm), arm_limits(arm), HOME, ORIENTATION, SCALE, REACH, TURN, float(ARM_ANGLE), _evaluated
    )


def _evaluated(compiled: CompiledMap, points: Array) -> Array:
    poses = np.empty((len(points), len(ARM_JOINTS)))
    poses_along(compiled.kind, compiled.params, compiled.memory, points, poses)
    return poses


def tilted_circle(radius: float, lap: float) -> Trajectory:
    """A circle about the origin of H, tilted by 30° towards the user, passed in `lap` seconds."""
    times = np.linspace(0.0, lap, 65)
    points = Trajectory.circle(radius, lap).point(times)
    tilt = np.radians(30.0)
    turned = np.stack([np.cos(tilt) * points[:, 0], points[:, 1], np.sin(tilt) * points[:, 0]], axis=1)
    turned[-1] = turned[0]
    return Trajectory(times, turned, periodic=True)


def wire_arm(
    config: ArmConfig, ready: Callable[[tuple[Unit, ...]], None] = lambda units: None
) -> tuple[Servo, RobotWorld, Trajectory]:
    """Wire a run of the arm: servo, world and curve; `ready` as in `experiments.setups.wiring.wire`.

    Raises
    ------
    ModelError, ControllerError, SimError
        If a number is out of its interval, the rates do not divide, or the curve leaves the workspace.
    """
    world = RobotWorld(config.scene)
    curve = reached(tilted_circle(config.radius, config.lap))
    program = Follow(curve, config.stiffness, config.damping, config.tube).program()
    period = config.scene.servo_period
    limiter = ForceLimiter(period)
    power = river_power(config.damping, fastest(curve))
    tank = tank_for(power, ((config.stiffness, config.tube),), config.radius, limiter)
    pushes = lap_pushes(config.lap, config.lap) if config.user == "push" else ()
    start = curve.point(curve.start) + np.random.default_rng(config.seed).normal(scale=1e-3, size=3)
    world.reset(start)
    stylus = np.empty(4)
    mujoco.mju_mat2Quat(stylus, world.data.site(PHANTOM + "tip").xmat)
    port = phantom_port(world.model, world.data, period, config.cutoff)
    check_reference(period * config.arm_ticks, config.smoothing, 0.0)
    nothing, arm_period = CompiledMap(ROBOT_ARM, np.zeros(0), np.zeros(0)), period * config.arm_ticks
    device = simulated_phantom(port, Arm(pushes=pushes))
    servo = Servo(
        plant=make_plant(world),
        device=device,
        field=unlinked_field(program, limiter, tank),
        reference=make_reference(world.arm, nothing, arm_period, config.smoothing),
        figure=robot_state(world, RATE),
        figure_ticks=config.arm_ticks,
        argument=device.hand[STYLUS_POSE],
    )  # fmt: skip
    # The map checks its domain with compiled code, so this comes after all other checks.
    ready(run_units(servo, program))
    compiled = robot_arm_map().compiled()
    world.put_arm(_evaluated(compiled, np.concatenate([start, stylus])[None])[0])
    reference = make_reference(world.arm, compiled, arm_period, config.smoothing)
    return servo._replace(reference=reference).linked(program), world, curve
