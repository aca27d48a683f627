r"""The map to a redundant robot arm: the stylus moves the end effector (tool) of an arm with seven joints.

The tool's pose is the stylus's, displaced, scaled and saturated at the edge of a domain (`saturation`):

.. math:: p_T = p_0 + \kappa\, f(p_H), \qquad R_T = \exp f(\log R_H)\; R_0

The joints follow by closed-form inverse kinematics (`arm_kinematics`) at a constant arm angle, so that a closed path of
the tool is a closed path of the joints. h_* differentiates the same steps.
"""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.errors import ParameterError
from controllers.haptic_map.arm_kinematics import arm_rates, bend_arm
from controllers.haptic_map.base import STYLUS_TANGENT, HapticMap, KernelMap
from controllers.saturation import saturate_vector
from geometry.arrays import Array
from geometry.rotations import angular_velocity, exponential, logarithm, rotation_vector_rate
from geometry.vectors import Vector, cross, product, turned

JOINTS = 7
_HOME, _SCALE, _REACH, _TURN, _ORIENTATION, _LENGTHS, _ARM_ANGLE, _SIZE = 0, 3, 4, 6, 8, 12, 16, 17

# [m], [rad] far enough that the saturated stylus is at the edge of its domain
_FAR_DISTANCE, _NEARLY_HALF_TURN = 1e3, 3.1
_MIN_BEND = np.radians(8.0)  # least angle from the singularities of shoulder, elbow and wrist, which are at zero


@njit
def _tool_angular_velocity(stylus: Array, turn: Array, turn_slope: Array, axis: int) -> Vector:
    """Angular velocity of the tool for a stylus that turns about an axis of H.

    `stylus` and `turn` are the rotation vectors of the stylus before and after saturation, `turn_slope` its derivative.
    """
    unit = 1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0
    # Angular velocities are in the fixed frame here, not the local one, hence the minus signs.
    rate = rotation_vector_rate(-stylus[0], -stylus[1], -stylus[2], unit[0], unit[1], unit[2])
    led_rate = (
        turn_slope[0, 0] * rate[0] + turn_slope[0, 1] * rate[1] + turn_slope[0, 2] * rate[2],
        turn_slope[1, 0] * rate[0] + turn_slope[1, 1] * rate[1] + turn_slope[1, 2] * rate[2],
        turn_slope[2, 0] * rate[0] + turn_slope[2, 1] * rate[1] + turn_slope[2, 2] * rate[2],
    )
    return angular_velocity(-turn[0], -turn[1], -turn[2], led_rate[0], led_rate[1], led_rate[2])


@njit
def robot_arm_map(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `RobotArm`: h(x), and h_*(x) unless `jacobian` has no rows."""
    place, place_slope = x[:3].copy(), np.empty((3, 3))
    saturate_vector(place, params[_REACH], params[_REACH + 1], place_slope)
    stylus, turn_slope = np.empty(3), np.empty((3, 3))
    stylus[0], stylus[1], stylus[2] = logarithm(x[3], x[4], x[5], x[6])
    turn = stylus.copy()
    saturate_vector(turn, params[_TURN], params[_TURN + 1], turn_slope)
    led = exponential(turn[0], turn[1], turn[2])
    home = params[_ORIENTATION], params[_ORIENTATION + 1], params[_ORIENTATION + 2], params[_ORIENTATION + 3]
    tool = product(led, home)
    base, upper, fore, hand = params[_LENGTHS], params[_LENGTHS + 1], params[_LENGTHS + 2], params[_LENGTHS + 3]
    lever, scale = turned(tool, (0.0, 0.0, hand)), params[_SCALE]
    wrist = (
        params[_HOME] + scale * place[0] - lever[0],
        params[_HOME + 1] + scale * place[1] - lever[1],
        params[_HOME + 2] + scale * place[2] - lever[2] - base,
    )
    posture = bend_arm(wrist, tool, upper, fore, params[_ARM_ANGLE], pose)
    for j in range(STYLUS_TANGENT if jacobian.shape[0] > 0 else 0):
        if j < 3:
            v = scale * place_slope[0, j], scale * place_slope[1, j], scale * place_slope[2, j]
            arm_rates(posture, pose, v, (0.0, 0.0, 0.0), jacobian[:, j])
        else:
            omega = _tool_angular_velocity(stylus, turn, turn_slope, j - 3)
            swing = cross(omega, lever)
            arm_rates(posture, pose, (-swing[0], -swing[1], -swing[2]), omega, jacobian[:, j])


class RobotArm(KernelMap):
    """The stylus moves the tool of a robot arm.

    A configuration is the seven joint angles [rad], a tangent their rates [rad/s]. Stylus positions saturate smoothly
    (C²) at a ball about the origin of H, and its rotations from upright at a largest angle: beyond, the arm stays at
    the edge. At a stylus turn of exactly half a turn the direction is ambiguous: h jumps there.

    Parameters
    ----------
    lengths : sequence of four floats
        Base to shoulder, shoulder to elbow, elbow to wrist, wrist to tool [m].
    home : Array-like, shape (3,)
        p_0, the tool's position in the frame of the arm's base when the stylus is at the origin of H [m].
    orientation : Array-like, shape (4,)
        R_0, the tool's orientation in that frame for an upright stylus, quaternion wxyz; its z axis is the tool's.
    scale : float
        κ, ratio of the tool's motion to the stylus's.
    reach : tuple of two floats
        Stylus distance up to which the tool follows exactly, and its bound in saturation [m].
    turn : tuple of two floats
        The same for the stylus's rotation from upright [rad].
    arm_angle : float
        ψ [rad].

    Raises
    ------
    ParameterError
        If a number is out of its interval. Whether the arm works in the whole domain is found by `check_domain`, which
        evaluates the map.
    """

    map_kernel = staticmethod(robot_arm_map)

    def __init__(
        self,
        lengths: Sequence[float],
        home: npt.ArrayLike,
        orientation: npt.ArrayLike,
        scale: float,
        reach: tuple[float, float],
        turn: tuple[float, float],
        arm_angle: float,
    ) -> None:
        q = np.asarray(orientation, dtype=float)
        numbers = (*np.ravel(home), scale, *reach, *turn, *(q / np.linalg.norm(q)), *lengths, arm_angle)
        super().__init__(np.array(numbers, dtype=float))
        if self._params.shape != (_SIZE,) or not np.isfinite(self._params).all():
            raise ParameterError(f"a robot arm's map has {_SIZE} finite numbers, got {numbers}")
        if not (scale > 0.0 and 0.0 < reach[0] < reach[1] and 0.0 < turn[0] < turn[1] < np.pi):
            raise ParameterError(
                f"scale {scale}, reach {reach} m, turn {turn} rad; expected positive numbers, intervals that increase"
            )

    @property
    def nq(self) -> int:
        """Numbers of a configuration: seven."""
        return JOINTS

    @property
    def nv(self) -> int:
        """Numbers of a tangent: seven."""
        return JOINTS

    def check_domain(self, limits: Array, evaluate: Callable[[HapticMap, Array], Array]) -> None:
        """Raise if the arm does not work at the centre or the edge of the domain, on a grid of directions and turns.

        Parameters
        ----------
        limits : Array, shape (7, 2)
            Least and greatest joint angles [rad].
        evaluate : callable
            Poses (n, 7) of a map at stylus poses (n, 7).

        Raises
        ------
        ParameterError
            If somewhere in the domain the arm does not reach, is near a singularity of shoulder, elbow or wrist, or
            exceeds a joint limit; the message says where.
        """
        directions = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)], dtype=float)
        directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1.0)
        far, bounds = (_FAR_DISTANCE, _NEARLY_HALF_TURN), (self._params[_REACH + 1], self._params[_TURN + 1])
        edge = [(place, turn) for place in directions for turn in directions]
        points = np.array([np.concatenate([far[0] * u, exponential.py_func(*(far[1] * v))]) for u, v in edge])
        for (u, v), q in zip(edge, evaluate(self, points), strict=True):
            straight = np.abs(q[[1, 3, 5]]).min() < _MIN_BEND
            if not np.isfinite(q).all() or straight or (q < limits[:, 0]).any() or (q > limits[:, 1]).any():
                raise ParameterError(
                    f"the arm cannot follow a stylus at {np.round(1e3 * bounds[0] * u)} mm turned by "
                    f"{np.round(np.degrees(bounds[1] * v))}°: joint angles {np.round(np.degrees(q))}°; expected "
                    f"them within {np.round(np.degrees(limits)).tolist()} and the joints 2, 4, 6 bent by "
                    f"{np.degrees(_MIN_BEND):.0f}° or more; take a smaller scale, reach or turn, or another home"
                )
