r"""Soft walls: what the target of a haptic map must not do is felt by the hand, pulled back through the map.

With q = h(x), its rates q̇ = h_* ẋ and for every joint angle or component of a rotation vector r_i an interval,

.. math:: F = -h_*^T \left(\nabla P(q) + \sum_j d\,\frac{(|\omega_j| - \omega_{max})_+}{|\omega_j|}\,\omega_j\right),
          \qquad P = \sum_i U(r_i - b_i) + U(a_i - r_i)

with U'(e) = k e²/2m up to e = m, k (e − m/2) beyond, 0 below: a spring that sets in softly, m [rad] before the limit
itself. The first part is −∇(P∘h): a potential, which gives back what it took. The second only takes: its power is
−Σ d (|ω_j| − ω_max)_+ |ω_j|.

Only where a map is at hand can a wall be evaluated: the servo calls `raise_walls` before `evaluate`, whose instruction
SOFT_WALL takes the wrench from the memory. So the laws of force do not depend on the maps.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from controllers.checks import checked
from controllers.errors import ParameterError
from controllers.fields.instructions import SOFT_WALL, Program
from controllers.haptic_map.base import STYLUS, STYLUS_TANGENT, HapticMap
from controllers.haptic_map.evaluate import evaluate_map_jacobian
from controllers.rotations import logarithm, rotation_vector_rate
from controllers.state import HAND_ANGULAR_VELOCITY, HAND_POSITION, HAND_VELOCITY, Array, HandState, IntArray, Wrench

WRENCH = 6
_KIND, _SIZE, _NQ, _NV, _JOINTS, _STIFFNESS, _MARGIN, _DAMPING, _SPEED, _HEADER = range(10)
_COLUMN, _ROW, _BALL, _LIMITS, _JOINT = 0, 1, 2, 3, 9  # of a joint: three intervals follow; a hinge has one


@njit
def wall_slope(angle: float, low: float, high: float, stiffness: float, margin: float) -> float:
    """U'(r − b) − U'(a − r) [N m] with a and b the margin within the limits; continuous, with its derivative."""
    excess = max(angle - high, low - angle) + margin
    if excess <= 0.0:
        return 0.0
    size = 0.5 * excess * excess / margin if excess < margin else excess - 0.5 * margin
    return stiffness * size if angle - high > low - angle else -stiffness * size


@njit
def _torque(params: Array, joint: int, pose: Array, rates: Array, torque: Array) -> None:
    """∇P and the damper's torque of one joint, written to `torque` (3,); its rates (3,) are ω."""
    k, m = params[_STIFFNESS], params[_MARGIN]
    column, limits = int(params[joint + _COLUMN]), joint + _LIMITS
    if params[joint + _BALL] == 0.0:
        torque[0] = wall_slope(pose[column], params[limits], params[limits + 1], k, m)
        torque[1] = torque[2] = 0.0
    else:
        x, y, z = logarithm(pose[column], pose[column + 1], pose[column + 2], pose[column + 3])
        a = wall_slope(x, params[limits], params[limits + 1], k, m)
        b = wall_slope(y, params[limits + 2], params[limits + 3], k, m)
        c = wall_slope(z, params[limits + 4], params[limits + 5], k, m)
        # ṙ = D(r) ω for a local ω, and D(r)ᵀ = D(−r).
        torque[0], torque[1], torque[2] = rotation_vector_rate(-x, -y, -z, a, b, c)
    speed = np.sqrt(rates[0] * rates[0] + rates[1] * rates[1] + rates[2] * rates[2])
    if speed > params[_SPEED]:
        share = params[_DAMPING] * (speed - params[_SPEED]) / speed
        for i in range(3):
            torque[i] += share * rates[i]


@njit
def soft_wall_wrench(wall: Array, pose: Array, jacobian: Array, hand: Array, wrench: Array) -> None:
    """Wrench of a wall whose parameters (see `SoftWall`) begin an array, at h (nq,) and h_* (nv, 6)."""
    rates, torque = np.zeros(3), np.empty(3)
    wrench[:] = 0.0
    for n in range(int(wall[_JOINTS])):
        joint = _HEADER + n * _JOINT
        row, size = int(wall[joint + _ROW]), 1 if wall[joint + _BALL] == 0.0 else 3
        for i in range(3):
            rates[i] = 0.0
            for j in range(3 if i < size else 0):
                rates[i] += jacobian[row + i, j] * hand[HAND_VELOCITY + j]
                rates[i] += jacobian[row + i, 3 + j] * hand[HAND_ANGULAR_VELOCITY + j]
        _torque(wall, joint, pose, rates, torque)
        for i in range(size):
            if torque[i] != 0.0:
                for j in range(STYLUS_TANGENT):
                    wrench[j] -= jacobian[row + i, j] * torque[i]


@njit
def raise_walls(units: IntArray, ops: IntArray, params: Array, memory: Array, hand: Array) -> None:
    """Write the wrench of every wall of a field into its memory, where `evaluate` finds it.

    Parameters
    ----------
    units : IntArray
        Of the walls' maps (see `controllers.haptic_map.evaluate`).
    ops, params, memory, hand
        As `controllers.fields.program.evaluate` takes them; a wall's memory is its wrench (6), then that of its map.
    """
    stylus = hand[HAND_POSITION : HAND_POSITION + STYLUS]
    for row in range(ops.shape[0]):
        if ops[row, 0] == SOFT_WALL:
            wall, kept = params[ops[row, 1] :], memory[ops[row, 2] :]
            first = _HEADER + int(wall[_JOINTS]) * _JOINT
            haptic_map = wall[first : first + int(wall[_SIZE])]
            pose, jacobian = np.empty(int(wall[_NQ])), np.empty((int(wall[_NV]), STYLUS_TANGENT))
            evaluate_map_jacobian(units, int(wall[_KIND]), haptic_map, stylus, kept[WRENCH:], pose, jacobian)
            soft_wall_wrench(wall, pose, jacobian, hand, kept[:WRENCH])


@dataclass(frozen=True, eq=False)
class SoftWall:
    r"""Limits of joint angles and joint speeds of a haptic map's target, felt in the control space.

    The force is continuous wherever h_* is, finite, and as large as h_* makes it: compose it with
    `Program.limited`. A joint turned by half a turn or more from rest has no unique rotation vector: there the force
    may jump.

    Parameters
    ----------
    haptic_map : HapticMap
        h.
    columns, rows : sequence of int
        Where each joint's numbers begin in a configuration and in a tangent.
    limits : sequence of Array
        Of each joint: shape (1, 2) of a hinge [rad], (3, 2) of a ball joint's rotation vector [rad].
    stiffness : float
        k [N m/rad].
    margin : float
        m, before the limit, where the wall begins [rad].
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

    @cached_property
    def _program(self) -> Program:
        kind, params, memory = self.haptic_map.compiled()
        header = [kind, len(params), self.haptic_map.nq, self.haptic_map.nv, len(self.limits)]
        gains = [self.stiffness, self.margin, self.damping, self.speed]
        table = np.zeros((len(self.limits), _JOINT))
        for joint, column, row, limit in zip(table, self.columns, self.rows, self.limits, strict=True):
            joint[:_LIMITS] = column, row, len(limit) == 3
            joint[_LIMITS : _LIMITS + limit.size] = np.ravel(limit)
        return Program.law(
            SOFT_WALL, np.concatenate([header, gains, table.ravel(), params]), [*[0.0] * WRENCH, *memory]
        )

    def program(self) -> Program:
        """Compiled form of the field."""
        return self._program

    def wrench(self, hand: HandState) -> Wrench:
        """Force and moment at one hand state, by the compiled law; the map's lap has just begun."""
        state, wrench = hand.vector(), np.empty(WRENCH)
        stylus = state[HAND_POSITION : HAND_POSITION + STYLUS]
        pose, jacobian = self.haptic_map.pose(stylus), self.haptic_map.jacobian(stylus)
        soft_wall_wrench(self._program.params, pose, jacobian, state, wrench)
        return Wrench(wrench[:3], wrench[3:])
