"""A robot arm of seven joints in place of the figure: the map's parts, for the same fields and the same loop."""

from typing import cast

import mujoco
import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.haptic_map.animation import ClipMap
from controllers.haptic_map.robot_arm import RobotArm as RobotArmMap
from experiments.setups.modes.rivers import default_choice
from experiments.setups.parts.hands import river_pushes
from experiments.setups.parts.pace import check_reach
from experiments.setups.parts.part_types import ClipMapParts
from models.robot_arm.spec import arm_lengths, arm_limits
from models.world.scene import PEDESTAL
from sim.reference.reference import map_poses

HOME = np.array([0.7, 0.0, 0.4])  # home position of the tool (end effector) in the frame of the arm's base [m]
_TOOL_TILT = np.radians(75.0)  # tilt of the tool from the vertical
ORIENTATION = np.array([np.cos(0.5 * _TOOL_TILT), 0.0, np.sin(0.5 * _TOOL_TILT), 0.0])
# [m] displacement up to which the tool follows the stylus exactly, and its bound in saturation
_TOOL_RANGE = (0.105, 0.15)
_TURN_RANGE = (np.radians(15.0), np.radians(25.0))  # [rad] the same for the rotation of the stylus
_ARM_ANGLE = np.radians(30.0)  # ψ of `controllers.haptic_map.robot_arm.RobotArm` [rad]
_SAMPLE_COUNT = 241  # samples of a curve in the search for its farthest point
_CIRCLE_TILT = np.radians(30.0)  # of the default circle, towards the user


def robot_arm_map(arm: mujoco.MjModel, scale: float) -> RobotArmMap:
    """The map by which the tool of an arm follows the stylus in front of it, its displacements scaled [1]."""
    near, far = (distance / scale for distance in _TOOL_RANGE)
    return RobotArmMap(arm_lengths(arm), HOME, ORIENTATION, scale, (near, far), _TURN_RANGE, float(_ARM_ANGLE))


def arm_parts(arm: mujoco.MjModel, curve: Trajectory, reach: float, scale: float) -> ClipMapParts:
    """Map parts of an arm in front of which the tool follows the stylus, about a curve.

    Parameters
    ----------
    arm : MjModel
        The arm alone.
    curve : Trajectory
        φ, with the timing that the hand is to have.
    reach : float
        Half width of the tube about the curve in which hands begin [m].
    scale : float
        Ratio of the tool's motion to the stylus's [1].

    Raises
    ------
    ParameterError
        If the scaled curve leads the tool farther than it follows exactly. What the arm does not reach is refused when
        the parts are refined, which evaluates the map.
    SimError
        If the Phantom does not reach the curve.
    """
    away = float(
        np.linalg.norm(check_reach(curve).point(np.linspace(curve.start, curve.end, _SAMPLE_COUNT)), axis=1).max()
    )
    if scale * away > _TOOL_RANGE[0]:
        raise ParameterError(
            f"the curve goes {1e3 * away:.0f} mm from the origin of H, and the tool at most "
            f"{1e3 * _TOOL_RANGE[0]:.0f} mm from its home; expected --scale {_TOOL_RANGE[0] / away:.2g} or less, or a "
            "smaller curve"
        )
    haptic_map = robot_arm_map(arm, scale)

    def refined() -> tuple[ClipMap, tuple[str, ...]]:
        haptic_map.check_domain(arm_limits(arm), map_poses)
        return cast(ClipMap, haptic_map), ()

    return ClipMapParts(
        haptic_map=cast(ClipMap, haptic_map), clips=(), curve=curve, reach=reach, turning=True, refined=refined,
        rivers=lambda mode: default_choice(mode, curve, reach),
        river_pushes=lambda mode, seconds: river_pushes(curve, seconds),
        static={"tool_home": HOME + np.array([0.0, 0.0, PEDESTAL]), "tool_scale": scale},
    )  # fmt: skip


def tilted(circle: Trajectory) -> Trajectory:
    """A curve about the vertical axis of H, tilted by 30° towards the user."""
    times = np.linspace(circle.start, circle.end, 65)
    points, cosine, sine = circle.point(times), np.cos(_CIRCLE_TILT), np.sin(_CIRCLE_TILT)
    x, y, z = points.T
    turned = np.stack([cosine * x - sine * z, y, sine * x + cosine * z], axis=1)
    turned[-1] = turned[0]
    return Trajectory(times, turned, periodic=True)
