r"""Soft walls: repulsion from the figure's joint limits, pulled back to the hand by the map's transposed Jacobian.

With q = h(x), its rates q̇ = h_* ẋ and an interval [a_i, b_i], the limits drawn in by the margin m, for every hinge
angle or component of a ball joint's rotation vector r_i,

.. math:: F = -h_*^T \left(\nabla P(q) + \sum_j d\,\frac{(|\omega_j| - \omega_{max})_+}{|\omega_j|}\,\omega_j\right),
          \qquad P = \sum_i U(r_i - b_i) + U(a_i - r_i)

with U'(e) = 0 for e < 0, k e²/2m for e up to m and k (e − m/2) beyond: a spring with a smooth onset, m [rad] before
the limit. The first part is conservative: −∇(P∘h) returns the energy that it stored. The second is dissipative, with
power −Σ d (|ω_j| − ω_max)_+ |ω_j|.

h and h_* at the stylus are written to the law's memory before it is evaluated (`controllers.fields.algebra.map_feed`).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.checks import checked
from controllers.errors import ParameterError
from controllers.fields.algebra.feed import Feed
from controllers.fields.algebra.instructions import TRACE_SIZE
from controllers.fields.algebra.law import Law, Program
from controllers.haptic_map.base import STYLUS_TANGENT, HapticMap
from controllers.state import HAND_ANGULAR_VELOCITY, HAND_VELOCITY
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.rotations import logarithm, rotation_vector_rate

# Layout of a joint's row: [column of qpos, row of qvel, is a ball joint, three intervals (a hinge uses the first)].
_COLUMN, _ROW, _IS_BALL, _LIMITS, _JOINT_SIZE = 0, 1, 2, 3, 9


class WallGains(NamedTuple):
    """Parameters of `soft_wall_wrench`; a row for each joint and the parameters of the map follow.

    nq and nv, number of joints, k [N m/rad], m [rad], d [N m s/rad] and ω_max [rad/s].
    """

    nq: float
    nv: float
    joints: float
    stiffness: float
    margin: float
    damping: float
    speed: float


_GAINS_SIZE = len(WallGains._fields)


@njit
def wall_slope(angle: float, low: float, high: float, stiffness: float, margin: float) -> float:
    """U'(r − b) − U'(a − r) [N m], a and b the limits [rad] drawn in by the margin; continuously differentiable."""
    excess = max(angle - high, low - angle) + margin
    if excess <= 0.0:
        return 0.0
    size = 0.5 * excess * excess / margin if excess < margin else excess - 0.5 * margin
    return stiffness * size if angle - high > low - angle else -stiffness * size


@njit
def _is_clear(params: Array, limits: int, margin: float, vector: Array) -> bool:
    """Whether a ball joint is certainly clear of its walls, by its quaternion's vector part (3,) and |r_i| ≤ π |q_i|.

    A cheap test that avoids the logarithm for most joints.
    """
    for i in range(3):
        low, high = params[limits + 2 * i], params[limits + 2 * i + 1]
        if np.pi * abs(vector[i]) > min(high, -low) - margin:
            return False
    return True


@njit
def _write_joint_torque(gains: WallGains, params: Array, joint: int, pose: Array, rates: Array, torque: Array) -> None:
    """Write ∇P plus the damper's torque of one joint [N m] to `torque` (3,); `rates` (3,) are its ω [rad/s]."""
    k, m = gains.stiffness, gains.margin
    column, limits = int(params[joint + _COLUMN]), joint + _LIMITS
    if params[joint + _IS_BALL] == 0.0:
        torque[0] = wall_slope(pose[column], params[limits], params[limits + 1], k, m)
        torque[1] = torque[2] = 0.0
    elif _is_clear(params, limits, m, pose[column + 1 : column + 4]):
        torque[0] = torque[1] = torque[2] = 0.0
    else:
        x, y, z = logarithm(pose[column], pose[column + 1], pose[column + 2], pose[column + 3])
        a = wall_slope(x, params[limits], params[limits + 1], k, m)
        b = wall_slope(y, params[limits + 2], params[limits + 3], k, m)
        c = wall_slope(z, params[limits + 4], params[limits + 5], k, m)
        # ṙ = D(r) ω for a local ω, and D(r)ᵀ = D(−r).
        torque[0], torque[1], torque[2] = rotation_vector_rate(-x, -y, -z, a, b, c)
    speed = np.sqrt(rates[0] * rates[0] + rates[1] * rates[1] + rates[2] * rates[2])
    if speed > gains.speed:
        share = gains.damping * (speed - gains.speed) / speed
        for i in range(3):
            torque[i] += share * rates[i]


@njit
def soft_wall_wrench(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
    """Kernel of `SoftWall`: parameters see `WallGains`, memory [h (nq), h_* (nv × 6), memory of the map]."""
    gains = WallGains(
        params[at], params[at + 1], params[at + 2], params[at + 3], params[at + 4], params[at + 5], params[at + 6]
    )  # fmt: skip
    nq, nv = int(gains.nq), int(gains.nv)
    pose, rest = memory[slot : slot + nq], slot + nq
    jacobian = memory[rest : rest + nv * STYLUS_TANGENT].reshape((nv, STYLUS_TANGENT))
    rates, torque = work_array(3), work_array(3)
    wrench[:] = 0.0
    for n in range(int(gains.joints)):
        joint = at + _GAINS_SIZE + n * _JOINT_SIZE
        row, size = int(params[joint + _ROW]), 1 if params[joint + _IS_BALL] == 0.0 else 3
        for i in range(3):
            rates[i] = 0.0
            for j in range(3 if i < size else 0):
                rates[i] += jacobian[row + i, j] * hand[HAND_VELOCITY + j]
                rates[i] += jacobian[row + i, 3 + j] * hand[HAND_ANGULAR_VELOCITY + j]
        _write_joint_torque(gains, params, joint, pose, rates, torque)
        for i in range(size):
            if torque[i] != 0.0:
                for j in range(STYLUS_TANGENT):
                    wrench[j] -= jacobian[row + i, j] * torque[i]


@dataclass(frozen=True, eq=False)
class SoftWall(Law):
    r"""Limits of the figure's joint angles and joint speeds, felt by the hand.

    The force is finite and continuous wherever h_* is, but grows without bound with h_*: compose it with
    `Law.limited`. A ball joint turned by half a turn or more from its zero position has no unique rotation vector, so
    the force may jump there.

    Parameters
    ----------
    haptic_map : HapticMap
        h.
    columns, rows : sequence of int
        Index of each joint's first number in a configuration (qpos) and in a tangent (qvel).
    limits : sequence of Array
        Interval of each joint: shape (1, 2) for a hinge [rad], (3, 2) for a ball joint's rotation vector [rad].
    stiffness : float
        k [N m/rad].
    margin : float
        m, angle before the limit at which the wall begins [rad].
    damping : float
        d [N m s/rad].
    speed : float
        ω_max of every joint [rad/s], may be infinite.

    Raises
    ------
    ParameterError
        If a joint is not one of the map's, an interval is empty or narrower than two margins, or a number is out of
        its interval.
    """

    haptic_map: HapticMap
    columns: tuple[int, ...]
    rows: tuple[int, ...]
    limits: tuple[Array, ...]
    stiffness: float
    margin: float
    damping: float
    speed: float = np.inf

    def __post_init__(self) -> None:
        checked("stiffness", self.stiffness, "N m/rad")
        checked("margin", self.margin, "rad", least=1e-6)
        checked("damping", self.damping, "N m s/rad")
        checked("speed", self.speed, "rad/s", least=1e-6, infinite=True)
        nq, nv = self.haptic_map.nq, self.haptic_map.nv
        if not len(self.columns) == len(self.rows) == len(self.limits):
            raise ParameterError(
                f"{len(self.columns)} columns, {len(self.rows)} rows and {len(self.limits)} limits; one each a joint"
            )
        for k, (column, row, limit) in enumerate(zip(self.columns, self.rows, self.limits, strict=True)):
            if limit.shape not in ((1, 2), (3, 2)):
                raise ParameterError(f"limits of joint {k} have shape {limit.shape}; expected (1, 2) or (3, 2)")
            ball = len(limit) == 3
            if not (0 <= column <= nq - (4 if ball else 1) and 0 <= row <= nv - len(limit)):
                raise ParameterError(f"joint {k} at {column} and {row} of a map with nq = {nq}, nv = {nv}")
            if not np.all(limit[:, 1] - limit[:, 0] >= 2.0 * self.margin):
                raise ParameterError(
                    f"limits of joint {k} are {limit.tolist()} rad; expected intervals of two margins "
                    f"({2.0 * self.margin:.3g} rad) or more"
                )

    def _compose(self) -> Program:
        """A new run starts with the initial memory of the map."""
        haptic_map = self.haptic_map
        _, params, memory, _ = haptic_map.compiled()
        gains = WallGains(
            haptic_map.nq, haptic_map.nv, len(self.limits), self.stiffness, self.margin, self.damping, self.speed
        )  # fmt: skip
        table = np.zeros((len(self.limits), _JOINT_SIZE))
        for joint, column, row, limit in zip(table, self.columns, self.rows, self.limits, strict=True):
            joint[:_LIMITS] = column, row, len(limit) == 3
            joint[_LIMITS : _LIMITS + limit.size] = np.ravel(limit)
        feed = Feed(haptic_map, TRACE_SIZE, _GAINS_SIZE + table.size)
        map_output = np.zeros(haptic_map.nq + haptic_map.nv * STYLUS_TANGENT)
        numbers = np.concatenate([gains, table.ravel(), params])
        return Program.of(self, soft_wall_wrench, numbers, np.concatenate([map_output, memory]), feeds=(feed,))
