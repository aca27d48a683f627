"""Expressive maps: the orientation of the stylus turns joints of any map's figure, for gaze and lean."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from controllers.curves.cylinder import blend_weight
from controllers.errors import ParameterError
from controllers.haptic_map.base import HapticMap, Wrapped
from controllers.haptic_map.map_stages import kernels_of
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.rotations import angular_velocity, exponential, logarithm, multiply, rotate, rotation_vector_rate

FADE_FROM = 2.0 * np.pi / 3.0  # [rad] stylus angle from which its effect fades out, to zero at half a turn
_JOINTS, _ROWS = 0, 1
_JOINT, _GAIN, _LOW, _HIGH, _ROW_SIZE = 0, 1, 4, 7, 10
_ROUNDING = 0.02  # [rad] smoothing of the distance to a joint limit near zero, so that it stays positive


@njit
def stylus_turn(x: Array, turn: Array, rates: Array) -> None:
    """Turn r of the stylus, F(|log R|) log R, for a stylus pose (7,); and ∂r/∂ω_H, shape (3, 3)."""
    a, b, c = logarithm(x[3], x[4], x[5], x[6])
    angle = np.sqrt(a * a + b * b + c * c)
    faded, slope = blend_weight(angle, FADE_FROM, np.pi)
    turn[0], turn[1], turn[2] = a, b, c
    for k in range(3):
        e_x, e_y, e_z = 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
        rate = rotation_vector_rate(-a, -b, -c, e_x, e_y, e_z)
        # The angle's rate is the component of ω along the axis; below FADE_FROM the slope is 0, so max() has no effect.
        fading = slope * turn[k] / max(angle, FADE_FROM)
        for i in range(3):
            rates[i, k] = (1.0 - faded) * rate[i] - fading * turn[i]
    for i in range(3):
        turn[i] *= 1.0 - faded


@njit
def saturate_at_limit(wanted: float, there: float, low: float, high: float) -> tuple[float, float, float]:
    r"""Turn f after soft saturation at a joint's limits, and its derivatives by `wanted` and by `there`.

    .. math:: f = y\,(1 + (y/R)^4)^{-1/4}

    Parameters
    ----------
    wanted, there : float
        Desired turn y, and the present value of the joint's component [rad].
    low, high : float
        Ends of its range [rad]; R is approximately the distance to the end in the direction of y, and stays positive.
    """
    side = 1.0 if wanted >= 0.0 else -1.0
    left = (high - there if side > 0.0 else there - low) - _ROUNDING
    root = np.sqrt(left * left + _ROUNDING * _ROUNDING)
    room = 0.5 * (left + root)
    u = wanted / room
    u4 = u * u * u * u
    passed = (1.0 + u4) ** -0.25
    by_wanted = passed / (1.0 + u4)
    return wanted * passed, by_wanted, -side * u * u4 * by_wanted * 0.5 * (1.0 + left / root)


@njit
def _turn_joint(row: Array, turn: Array, rates: Array, q: Array, jacobian: Array) -> None:
    """Turn one joint: its quaternion q (4,) and, unless `jacobian` has no rows, its derivative (3, 6)."""
    v = logarithm(q[0], q[1], q[2], q[3])
    e, by_turn, by_there = work_array(3), work_array(3), work_array(3)
    for i in range(3):
        gain = row[_GAIN + i]
        e[i], slope, by_there[i] = saturate_at_limit(gain * turn[i], v[i], row[_LOW + i], row[_HIGH + i])
        by_turn[i] = slope * gain
    w, x, y, z = exponential(e[0], e[1], e[2])
    q[0], q[1], q[2], q[3] = multiply(q[0], q[1], q[2], q[3], w, x, y, z)
    for k in range(jacobian.shape[1] if jacobian.shape[0] > 0 else 0):
        a, b, c = jacobian[0, k], jacobian[1, k], jacobian[2, k]
        d = rotation_vector_rate(v[0], v[1], v[2], a, b, c)
        dx, dy, dz = by_there[0] * d[0], by_there[1] * d[1], by_there[2] * d[2]
        if k >= 3:
            dx += by_turn[0] * rates[0, k - 3]
            dy += by_turn[1] * rates[1, k - 3]
            dz += by_turn[2] * rates[2, k - 3]
        own = angular_velocity(e[0], e[1], e[2], dx, dy, dz)
        carried = rotate(w, -x, -y, -z, a, b, c)
        for i in range(3):
            jacobian[i, k] = own[i] + carried[i]


@njit
def express(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `Expressive`: turn joints of the base map's pose by the stylus, and the derivative unless it is empty.

    Parameters
    ----------
    params : Array
        Parameters of an `Expressive`.
    x : Array, shape (7,)
        Stylus pose.
    memory : Array
        Memory of the base map; neither read nor written.
    pose, jacobian : Array, shapes (nq,), (nv, 6)
        Pose and derivative of the base map; updated.
    """
    turn, rates = work_array(3), work_array((3, 3))
    stylus_turn(x, turn, rates)
    for n in range(int(params[_JOINTS])):
        row = params[_ROWS + _ROW_SIZE * n : _ROWS + _ROW_SIZE * (n + 1)]
        joint = int(row[_JOINT])
        first = 3 + 3 * joint if jacobian.shape[0] > 0 else 0
        rows = jacobian[first : first + 3]
        _turn_joint(row, turn, rates, pose[3 + 4 * joint : 7 + 4 * joint], rows)


@dataclass(frozen=True)
class ExpressiveJoint:
    """A joint that turns with the stylus.

    Parameters
    ----------
    joint : int
        Joint k has the numbers 3 + 4k to 6 + 4k of a pose; the root, 0, is not allowed.
    gain : (float, float, float)
        Turn about the axes x, y, z of the joint's own frame per turn of the stylus about x, y, z of H [rad/rad].
    low, high : (float, float, float)
        Range of the joint's rotation vector [rad].
    """

    joint: int
    gain: tuple[float, float, float]
    low: tuple[float, float, float]
    high: tuple[float, float, float]


class Expressive(Wrapped):
    r"""A map with joints that also turn with the stylus: gaze and lean.

    .. math:: q_k(p, R) = q_k(p) \otimes \exp e_k, \qquad e_{k,i} = f(g_{k,i}\, r_i;\, R_{k,i}), \qquad r = F \log R

    q_k is the base map's rotation of joint k; r the turn of the stylus from upright, the rotation vector of R about the
    axes of H (roll, pitch and yaw). f(y; R) = y (1 + (y/R)⁴)^(−1/4) is a soft saturation: it passes small turns
    unchanged and stays below the room R that the pose leaves up to the joint's limit, for each component of the joint's
    rotation vector. All other joints and the root, and for an upright stylus the whole pose, are those of the base map.

    F is 1 up to a turn of 120° and eases to 0 at 180°: half a turn to the left equals half a turn to the right, so a
    continuous map cannot distinguish them there. h is C² in R everywhere, and C² in the base map's pose except where a
    turned joint is half a turn from its zero.

    Parameters
    ----------
    base : HapticMap
        A map to poses of root position, root quaternion, then joint quaternions (wxyz).
    joints : sequence of ExpressiveJoint
        At least one.

    Raises
    ------
    ParameterError
        If the base map has other poses, lacks these joints or wraps a map itself, a gain is not finite, or a range is
        empty.
    """

    map_kernel = staticmethod(express)

    def __init__(self, base: HapticMap, joints: Sequence[ExpressiveJoint]) -> None:
        last = (base.nq - 7) // 4
        if base.nq != 7 + 4 * last or base.nv != 6 + 3 * last:
            raise ParameterError(
                f"expression turns joints of poses with 7 + 4 n numbers and 6 + 3 n of a tangent; "
                f"the base map has {base.nq} and {base.nv}"
            )
        if express in kernels_of(base.compiled().stages):
            raise ParameterError("the base of an expressive map is one itself; give all joints to one of them")
        if not joints:
            raise ParameterError("expression needs at least one joint that turns with the stylus")
        rows = [_checked_row(joint, last) for joint in joints]
        super().__init__(base, np.concatenate([[len(rows)], *rows]))


def _checked_row(joint: ExpressiveJoint, last: int) -> Array:
    if not 1 <= joint.joint <= last:
        raise ParameterError(f"the poses have joints 1 to {last}, expression needs joint {joint.joint}")
    gain, low, high = (np.asarray(numbers, dtype=np.float64) for numbers in (joint.gain, joint.low, joint.high))
    if gain.shape != (3,) or not np.isfinite(gain).all():
        raise ParameterError(f"gains of joint {joint.joint} must be three finite numbers, got {joint.gain}")
    if low.shape != (3,) or high.shape != (3,) or not (low < high).all():
        raise ParameterError(f"the range of joint {joint.joint} must be three intervals, got {joint.low}, {joint.high}")
    return np.concatenate([[joint.joint], gain, low, high])
