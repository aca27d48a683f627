r"""Weighted mean pose of several clips at a phase, and its derivative.

.. math:: h = A \cdot \exp\bigl(\tfrac{\theta}{2\pi} \textstyle\sum_i w_i \xi_i\bigr) \cdot \bar{\rho}_w(\theta)

θ is the phase of the lap. Positions are blended linearly, rotations by their chordal mean (`mean`), the drift over
the ground by its twist ξ (`loops`); the ends of limbs are blended like the root, and the limbs follow by inverse
kinematics (`limbs`). A ∈ SE(2) is the frame of the lap, stored in the memory (`lap`).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.borrowed import without_refcount
from controllers.legs.floor import keep_above
from controllers.legs.limb_kinematics import solve_limb
from controllers.legs.limbs import LAST, LIMB_SIZE, N_END_CHANNELS, Limb
from controllers.legs.stance_hold import advance_hand, carry_root, hold_stance_foot
from controllers.motion.inbetween import FOOT, ROOT
from controllers.motion.lap import LAP_HEADING, LAP_X, LAP_Y, LAST_ANGLE, MEMORY, drift_motion, update_lap
from controllers.motion.mean import mean_derivative, mean_rotation, signed_mean, signed_mean_derivative
from controllers.work_array import work_array
from geometry.arrays import Array, IntArray
from geometry.rotations import multiply
from geometry.vectors import unit_rotation

_ROTATIONS, _LIMBS, _GROUPS = range(3)
SIGNED = 2  # added to the group of a joint that is blended by `signed_mean`
_PARAMETERS = 3  # parameters of a pose: θ, and two that change only the weights


@njit
def figure_size(figure: Array) -> int:
    """Length of the `packed_figure` at the start of an array."""
    return _GROUPS + int(figure[_ROTATIONS]) + LIMB_SIZE * int(figure[_LIMBS])


@njit
def figure_limbs(figure: Array) -> int:
    """Number of limbs of a `packed_figure` at the start of an array."""
    return int(figure[_LIMBS])


@njit
def figure_channels(figure: Array) -> int:
    """Channels of a clip: root position, rotations, ends of limbs."""
    return 3 + 4 * int(figure[_ROTATIONS]) + N_END_CHANNELS * int(figure[_LIMBS])


@njit
def _mean_position(value: Array, slope: Array, column: int, weights: Array, changes: Array, mean: Array) -> None:
    """Mean of three channels, rows: value, derivatives by θ and the two other parameters."""
    mean[:] = 0.0
    for i in range(value.shape[0]):
        for k in range(3):
            mean[0, k] += weights[i] * value[i, column + k]
            mean[1, k] += weights[i] * slope[i, column + k]
            for parameter in range(_PARAMETERS):
                mean[1 + parameter, k] += changes[parameter, i] * value[i, column + k]


@njit
def _mean_rotations(
    figure: Array, value: Array, slope: Array, weights: Array, changes: Array, q: Array, rates: Array, tangents: int
) -> None:
    """Mean rotation of the root and each joint with the weights of its group, and its local angular velocities."""
    unit, spin = work_array((value.shape[0], 4)), work_array((value.shape[0], 3))
    for joint in range(q.shape[0]):
        signed, group = divmod(int(figure[_GROUPS + joint]), SIGNED)
        at = 3 + 4 * joint
        for i in range(value.shape[0]):
            x, y, z = unit_rotation(value[i, at : at + 4], slope[i, at : at + 4], 1.0, unit[i])
            spin[i, 0], spin[i, 1], spin[i, 2] = x, y, z
        if signed:
            signed_mean(unit, weights[group], q[joint])
            if tangents:
                signed_mean_derivative(unit, spin, weights[group], changes[group], q[joint], rates[joint])
            continue
        mean_rotation(unit, weights[group], q[joint])
        if tangents:
            mean_derivative(unit, spin, weights[group], changes[group], q[joint], rates[joint])


@njit
def _turn_position(angle: float, turn: Array, x: float, y: float, shift: Array, p: Array) -> None:
    """Move a position and its derivatives by a displacement of the plane: turn by an angle, then shift by (x, y).

    `turn` (3,) and `shift` (2, 3) hold the derivatives of angle and shift.
    """
    c, s = np.cos(angle), np.sin(angle)
    for k in range(_PARAMETERS):
        dx, dy = p[1 + k, 0] - turn[k] * p[0, 1], p[1 + k, 1] + turn[k] * p[0, 0]
        p[1 + k, 0], p[1 + k, 1] = c * dx - s * dy + shift[0, k], s * dx + c * dy + shift[1, k]
    p[0, 0], p[0, 1] = c * p[0, 0] - s * p[0, 1] + x, s * p[0, 0] + c * p[0, 1] + y


@njit
def _turn_rotation(angle: float, turn: Array, q: Array, rate: Array) -> None:
    """Turn a rotation about the vertical by an angle with derivatives `turn`; rates are local, shape (3, 3)."""
    up_x, up_y = 2.0 * (q[1] * q[3] - q[0] * q[2]), 2.0 * (q[2] * q[3] + q[0] * q[1])
    up_z = 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])
    for k in range(_PARAMETERS):
        rate[0, k] += turn[k] * up_x
        rate[1, k] += turn[k] * up_y
        rate[2, k] += turn[k] * up_z
    q[0], q[1], q[2], q[3] = multiply(np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle), q[0], q[1], q[2], q[3])


@njit
def _move_lap(memory: Array, heading: float, shift: tuple[float, float]) -> None:
    """Move the frame of the lap over the ground by a vector that is given at a heading."""
    c, s = np.cos(heading), np.sin(heading)
    memory[LAP_X] += c * shift[0] - s * shift[1]
    memory[LAP_Y] += s * shift[0] + c * shift[1]


@njit
def _chain_rule(root: Array, rates: Array, chain: Array, jacobian: Array) -> None:
    """Derivatives of the pose by the stylus, from those by the three parameters and theirs by the stylus."""
    for j in range(jacobian.shape[1]):
        if chain[0, j] == 0.0 and chain[1, j] == 0.0 and chain[2, j] == 0.0:
            jacobian[:, j] = 0.0
            continue
        for i in range(3):
            jacobian[i, j] = root[1, i] * chain[0, j] + root[2, i] * chain[1, j] + root[3, i] * chain[2, j]
        for joint in range(rates.shape[0]):
            for i in range(3):
                rate = rates[joint, i]
                total = rate[0] * chain[0, j] + rate[1] * chain[1, j] + rate[2] * chain[2, j]
                jacobian[3 + 3 * joint + i, j] = total


class ClipsAt(NamedTuple):
    """Clips at one phase of the lap.

    Attributes
    ----------
    value, slope : Array, shape (clips, channels)
        Channels of each clip at θ, and their derivatives by θ; λ of a limb is read from the first clip's.
    drifts : Array, shape (clips, 3)
        ξ of each clip.
    """

    value: Array
    slope: Array
    drifts: Array


class Mixture(NamedTuple):
    """How clips are mixed.

    Attributes
    ----------
    weights : Array, shape (groups, clips)
        Sum 1; group 0 is that of the root. Slightly negative weights are allowed (see `mean`).
    changes : Array, shape (groups, 3, clips)
        Derivatives of the weights by θ and two other parameters.
    chain : Array, shape (3, 6)
        Derivatives of the three parameters by the stylus.
    correction : Array, shape (4, 2 + 4 limbs)
        Displacements of root and ends (see `inbetween`), and the derivatives by the three parameters; (4, 0) for none.
    """

    weights: Array
    changes: Array
    chain: Array
    correction: Array


class Ground(NamedTuple):
    """The ground under the ends of limbs.

    Attributes
    ----------
    footing : Array
        Memory of the ends' footing (see `stance_hold`); updated. If empty, ends are not held.
    mixing : float
        μ of the clips that move the ends (`mixing_degree`).
    soles : Array, shape (limbs, k, 3)
        Sole points of each end, from their centre [m]. If empty, ends are not kept above the floor.
    contact, floor : float
        Height of ground contact, and the height below which no sole point is allowed [m].
    """

    footing: Array
    mixing: float
    soles: Array
    contact: float
    floor: float


@njit
def _mean_end(
    clips: ClipsAt, drift: Array, mixture: Mixture, n: int, column: int, end: Array, q: Array, rates: Array
) -> None:  # fmt: skip
    """Mean place and orientation of the end of limb n in the frame of the drift, from its channels at a column."""
    value, slope, correction, heading = clips.value, clips.slope, mixture.correction, 0.0
    _mean_position(value, slope, column, mixture.weights[0], mixture.changes[0], end)
    corrected, at = correction.shape[1] > 0, ROOT + FOOT * n
    if corrected:
        end += correction[:, at : at + 3]
        heading = correction[0, at + 3]
    lag, shift, turn = value[0, column + 3], work_array((2, 3)), work_array(3)
    x, y = drift_motion(drift, lag, 2.0 * np.pi * slope[0, column + 3], shift, turn)
    _turn_position(lag * drift[0, 2], turn, x, y, shift, end)
    if corrected:
        turn += correction[1:, at + 3]
    _turn_rotation(lag * drift[0, 2] + heading, turn, q, rates)


@njit
def _hold_feet(
    limbs: Array, memory: Array, angle: float, drift: Array, ground: Ground, ends: Array, q: Array
) -> None:  # fmt: skip
    """Keep feet in stance at their places, and let the frame of the lap follow them (`stance_hold`)."""
    footing, mixing, soles, contact, _ = ground
    s, lap, count = angle / (2.0 * np.pi), memory[LAP_HEADING], ends.shape[0]
    ahead, frame, heading = advance_hand(footing, angle), work_array(3), s * drift[0, 2] + lap
    _move_lap(memory, heading, carry_root(footing, count, ahead))
    shift, turn = work_array((2, 3)), work_array(3)
    x, y = drift_motion(drift, s, 1.0, shift, turn)
    frame[0] = memory[LAP_X] + np.cos(lap) * x - np.sin(lap) * y
    frame[1] = memory[LAP_Y] + np.sin(lap) * x + np.cos(lap) * y
    frame[2] = heading
    for n in range(count):
        last = int(limbs[LIMB_SIZE * n + LAST])
        hold_stance_foot(footing, n, ahead, mixing, soles[n], contact, frame, ends[n, 0], q[last])
    x, y = carry_root(footing, count, ahead)
    _move_lap(memory, heading, (x, y))
    for n in range(count):
        ends[n, 0, 0] -= x
        ends[n, 0, 1] -= y


@njit
def combine(
    figure: Array, clips: ClipsAt, angle: float, mixture: Mixture, memory: Array, ground: Ground, pose: Array,
    jacobian: Array,
) -> None:  # fmt: skip
    """Mean of poses, and its derivative unless `jacobian` has no rows.

    Parameters
    ----------
    figure : Array
        `packed_figure`, at the start of the array.
    clips : ClipsAt
        The clips at θ.
    angle : float
        θ in [0, 2π].
    mixture : Mixture
        Their weights.
    memory : Array
        The frame of the lap; updated.
    ground : Ground
        What holds the ends.
    pose, jacobian : Array, shapes (nq,), (nv, 6)
        Written.
    """
    _combine_borrowed(
        without_refcount(figure), without_refcount(clips), angle, without_refcount(mixture), without_refcount(memory),
        without_refcount(ground), without_refcount(pose), without_refcount(jacobian),
    )  # fmt: skip


@njit(forceinline=True)
def _combine_borrowed(
    figure: Array, clips: ClipsAt, angle: float, mixture: Mixture, memory: Array, ground: Ground, pose: Array,
    jacobian: Array,
) -> None:  # fmt: skip
    value, slope, drifts = clips
    weights, changes, chain, correction = mixture
    rotations, limbs = int(figure[_ROTATIONS]), int(figure[_LIMBS])
    packed = figure[_GROUPS + rotations :]
    tangents = _PARAMETERS if jacobian.shape[0] > 0 else 0

    drift, shift, turn = work_array((1 + _PARAMETERS, 3)), work_array((2, 3)), work_array(3)
    constant = work_array(drifts.shape)
    constant[:] = 0.0
    _mean_position(drifts, constant, 0, weights[0], changes[0], drift)
    update_lap(memory, angle, drift[0])
    q, rates = work_array((rotations, 4)), work_array((rotations, 3, 3))
    _mean_rotations(figure, value, slope, weights, changes, q, rates, tangents)
    root, ends = work_array((4, 3)), work_array((limbs, 4, 3))
    _mean_position(value, slope, 0, weights[0], changes[0], root)
    if correction.shape[1] > 0:
        for k in range(1 + _PARAMETERS):
            root[k, 0] += correction[k, 0]
            root[k, 1] += correction[k, 1]
    for n in range(limbs):
        last, column = int(packed[LIMB_SIZE * n + LAST]), 3 + 4 * rotations + N_END_CHANNELS * n
        _mean_end(clips, drift, mixture, n, column, ends[n], q[last], rates[last])
        if ground.soles.shape[0] > 0:
            keep_above(ground.floor, ground.soles[n], ends[n], q[last], rates[last], tangents)
    if ground.footing.shape[0] > 0:
        _hold_feet(packed, memory, angle, drift, ground, ends, q)
    for n in range(limbs):
        solve_limb(packed[LIMB_SIZE * n : LIMB_SIZE * (n + 1)], q, rates, root, ends[n], tangents)

    # Root and ends are given in the frame of the drift, and that in the frame of the lap.
    s, lap = angle / (2.0 * np.pi), memory[LAP_HEADING]
    x, y = drift_motion(drift, s, 1.0, shift, turn)
    _turn_position(s * drift[0, 2], turn, x, y, shift, root)
    _turn_rotation(s * drift[0, 2] + lap, turn, q[0], rates[0])
    shift[:], turn[:] = 0.0, 0.0
    _turn_position(lap, turn, memory[LAP_X], memory[LAP_Y], shift, root)
    pose[0], pose[1], pose[2] = root[0, 0], root[0, 1], root[0, 2]
    for joint in range(rotations):
        for j in range(4):
            pose[3 + 4 * joint + j] = q[joint, j]
    if tangents:
        _chain_rule(root, rates, chain, jacobian)


def packed_figure(groups: IntArray, limbs: Sequence[Limb]) -> Array:
    """Parameters of `combine`: the group of weights of the root and each joint (1 + joints,), and the limbs.

    `SIGNED` is added to the group of a joint whose quaternions have signs that are continuous round the lap.
    """
    return np.concatenate([[len(groups), len(limbs)], groups, *(limb.packed() for limb in limbs)])


def weight_groups(figure: Array) -> Array:
    """View of the group of weights of root and each joint, in a `packed_figure` at the start of an array."""
    return figure[_GROUPS : _GROUPS + int(figure[_ROTATIONS])]


def fresh_lap() -> Array:
    """Memory of a blend at the start of a run."""
    memory = np.zeros(MEMORY)
    memory[LAST_ANGLE] = np.nan
    return memory
