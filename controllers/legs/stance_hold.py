r"""Run-time removal of foot skate: feet in stance keep their place on the floor while the hand changes the blend.

The corrections of a mixture (`pair_corrections`) hold a foot only while the mixture is constant. The foot would slide
when the hand changes the mixture, and with it the foot's mean position, or between the mixtures that were corrected. So
each end has an offset o over the ground, and one ψ of its heading, stored in the memory. They cancel a fraction σ of
the slip Δp of the end's touching points and of its turning. They fade as the end swings through the air, and, slowly,
where a clip has been alone for long:

.. math:: o \leftarrow o - \sigma\,\Delta p, \qquad
          \sigma = \sigma_0(h)\,m\,\bigl(1 - o^2/o_{max}^2 - \psi^2/\psi_{max}^2\bigr)_+, \qquad
          \frac{do}{d\theta} = -\bigl(\kappa\,(1 - \sigma_0) + \kappa_1 (1 - m)\bigr)\, o .

The degree of stance σ₀ falls with the height h of the sole. The mixing degree μ is 0 where a clip is alone: a clip
keeps its own foot skate, so that h∘α̃ = α. m is the largest μ of this stance: a foot that landed in a mixture stands
until it is lifted, though a clip may be alone by then,

.. math:: m \leftarrow \max(\mu, m), \qquad
          \frac{dm}{d\theta} = -\bigl(\kappa\,(1 - \sigma_0) + \kappa_1 (1 - \mu)\bigr)\, m .

A root that stays behind its feet, or ahead of them, would fall. So the frame A of the lap, and with it the root, moves
by a share of the mean offset of the feet in stance; feet stay where they are, and their offsets shrink by as much:

.. math:: \delta = \bigl(1 - e^{-\kappa_r\,\Delta\theta}\bigr)\,\frac{\sum \sigma_0\, o}{\max(\sum \sigma_0,\, 1)},
          \qquad A \leftarrow A + \delta, \quad o \leftarrow o - \delta ,

half of it before the feet are held and half of it after that, so that a step back undoes it.

σ and σ₀ are means over the step. While a hand moves back a little, the offset grows again, until the direction counts
as reversed; so velocity and acceleration of the figure may be computed by one-sided differences. h_* is the derivative
at a given offset.
"""

from collections.abc import Sequence

import numpy as np
from numba import njit

from controllers.errors import ParameterError
from controllers.legs.limbs import Limb
from controllers.legs.sole_heights import STANCE_HEIGHT
from controllers.state import Quat
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.easing import smooth_step
from geometry.rotations import multiply, rotate
from geometry.vectors import Quaternion

# [m] height of the sole above which σ₀ is 0; up to `STANCE_HEIGHT` it is 1. In the example at `_MAX_OFFSET` feet slide
# 0.2 cm, with 4.5 mm 0.5 cm, with 8 mm (`SWING_HEIGHT`) 0.1 cm and with 12 mm 0.2 cm.
_RELEASE_HEIGHT = 0.006
# |1 − Σ w²| up to which μ is 0, and from which it is 1: for two clips, weights 0.999 and 0.947. A foot is to be held
# from the beginning of a change on: with weights 0.985 and 0.72 feet slide 7.4 cm in changes from a walk to a jog, and
# 5.9 cm with these, both with an offset of 0.15 m at most.
_ALONE, _MIXED = 0.002, 0.1
# κ and κ₁ [1/rad]. In the example at `_MAX_OFFSET` the slide is 0.1 cm with half of κ and 0.2 cm with twice.
_FADE_RATE, _ALONE_FADE_RATE = 5.0, 0.2
# κ_r [1/rad]. With 0, this, 1 and 3 the figure needs 9.4, 8.0, 7.7 and 8.7 % of weight in changes from a jog to a walk,
# and 10.4, 11.2, 12.1 and 14.5 % in others from a run; with the first three 16, 10 and 13 % on a bent walk.
_ROOT_RATE = 0.5
# [m], [rad] largest offset. For a hand that visits walk, run, jump and angry once a lap, feet slide 5.8 cm without
# footing and 0.2 cm with it; 0.3 cm with half the first number and 0.1 cm with twice.
_MAX_OFFSET, _MAX_TURN = 0.3, 0.8
_CONTACT_SCALE = 1e-3  # [m] scale of heights in the weights of the touching points
_REVERSAL_ANGLE = 0.15  # [rad] backward motion after which the hand's direction counts as reversed
_MAX_ANGLE_STEP = 1.0  # [rad] larger than any change of the hand's angle in one tick
# A footing, the memory: the direction in which the hand goes round (±1), how far it has gone back since [rad], its last
# angle [rad]; then of each end its offset (x, y [m], ψ [rad]), and of the last step the position of its centre over the
# ground (2) [m], its orientation (4, zeros before the first step), σ, σ₀ and m.
_DIRECTION, _BACKTRACK, _ANGLE, _ENDS = range(4)
_OFFSET, _POSITION, _TURN, _HOLD, _STANCE, _MIXING, _END_SIZE = 0, 3, 5, 9, 10, 11, 12


def fresh_footing(limbs: int) -> Array:
    """Memory of the footing of a number of limbs at the start of a run."""
    memory = np.zeros(_ENDS + _END_SIZE * limbs)
    memory[_DIRECTION], memory[_ANGLE] = 1.0, np.nan
    return memory


def packed_soles(limbs: Sequence[Limb]) -> Array:
    """Sole points of limbs, relative to their centre [m], packed one after the other for `hold_stance_foot`.

    Raises
    ------
    ParameterError
        If the limbs differ in their number of points.
    """
    if len({len(limb.points) for limb in limbs}) > 1:
        raise ParameterError(f"limbs must have equally many points, got {[len(limb.points) for limb in limbs]}")
    return np.concatenate([np.zeros(0), *((limb.points - limb.points.mean(axis=0)).ravel() for limb in limbs)])


@njit
def _degree_of_stance(height: float) -> float:
    """σ₀ of a sole at a height over the ground [m]: a C² step from 1 at `STANCE_HEIGHT` to 0 at `_RELEASE_HEIGHT`."""
    return smooth_step((_RELEASE_HEIGHT - height) / (_RELEASE_HEIGHT - STANCE_HEIGHT))


@njit
def advance_hand(footing: Array, angle: float) -> float:
    """Store the angle of the hand; returns its step [rad] in the hand's current direction, negative if backwards."""
    step = angle - footing[_ANGLE]
    footing[_ANGLE] = angle
    if not np.isfinite(step):
        return 0.0
    step -= 2.0 * np.pi * np.round(step / (2.0 * np.pi))
    ahead = footing[_DIRECTION] * step
    footing[_BACKTRACK] = max(footing[_BACKTRACK] - ahead, 0.0)
    if footing[_BACKTRACK] > _REVERSAL_ANGLE:
        footing[_DIRECTION], footing[_BACKTRACK] = -footing[_DIRECTION], 0.0
    return ahead


@njit
def mixing_degree(weights: Array) -> float:
    """μ of weights (m,): 1 for a mixture, 0 for a clip alone."""
    square = 0.0
    for w in weights:
        square += w * w
    return smooth_step((abs(1.0 - square) - _ALONE) / (_MIXED - _ALONE))


@njit
def carry_root(footing: Array, limbs: int, ahead: float) -> tuple[float, float]:
    """Reduce the offsets by half of δ, which is returned: (x, y) [m], in the frame in which the ends are given.

    Parameters
    ----------
    footing : Array
        The memory; updated.
    limbs : int
        Number of limbs.
    ahead : float
        Step of the hand (`advance_hand`) [rad].
    """
    stances, x, y = 0.0, 0.0, 0.0
    for n in range(limbs):
        at = _ENDS + _END_SIZE * n
        stances += footing[at + _STANCE]
        x += footing[at + _STANCE] * footing[at + _OFFSET]
        y += footing[at + _STANCE] * footing[at + _OFFSET + 1]
    share = (1.0 - np.exp(-0.5 * _ROOT_RATE * ahead)) / max(stances, 1.0)
    x, y = share * x, share * y
    for n in range(limbs):
        at = _ENDS + _END_SIZE * n + _OFFSET
        footing[at] -= x
        footing[at + 1] -= y
    return x, y


@njit
def _turn_sole(sole: Array, q: Quaternion, levers: Array) -> float:
    """Write the points of a sole (k, 3) turned by q; returns the height of the lowest."""
    least = np.inf
    for i in range(sole.shape[0]):
        x, y, z = rotate(q[0], q[1], q[2], q[3], sole[i, 0], sole[i, 1], sole[i, 2])
        levers[i, 0], levers[i, 1], levers[i, 2] = x, y, z
        least = min(least, z)
    return least


@njit
def _yaw(angle: float, q: Array) -> Quaternion:
    return multiply(np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle), q[0], q[1], q[2], q[3])


@njit
def _slip_of_turn(levers: Array, low: float, before: Array, low_before: float, back: float) -> tuple[float, float]:
    """Displacement (x, y) of a sole's touching points relative to its centre [m], as the sole turned from `before`.

    Parameters
    ----------
    levers, before : Array, shape (k, 3)
        Points relative to the centre now, and at the last step [m].
    low, low_before : float
        Heights of the lowest of them [m]: the higher a point is above it, the less it touches.
    back : float
        Heading by which the sole is turned back now [rad].
    """
    turned_c, turned_s = np.cos(back), np.sin(back)
    total, moved_x, moved_y = 0.0, 0.0, 0.0
    for i in range(levers.shape[0]):
        touch = np.exp((low - levers[i, 2]) / _CONTACT_SCALE) + np.exp((low_before - before[i, 2]) / _CONTACT_SCALE)
        moved_x += touch * (turned_c * levers[i, 0] - turned_s * levers[i, 1] - before[i, 0])
        moved_y += touch * (turned_s * levers[i, 0] + turned_c * levers[i, 1] - before[i, 1])
        total += touch
    return moved_x / total, moved_y / total


@njit
def _limit_offset(state: Array) -> None:
    """Shorten the offset of an end to `_MAX_OFFSET`, and its heading to `_MAX_TURN`."""
    distance = np.sqrt(state[_OFFSET] ** 2 + state[_OFFSET + 1] ** 2)
    if distance > _MAX_OFFSET:
        state[_OFFSET] *= _MAX_OFFSET / distance
        state[_OFFSET + 1] *= _MAX_OFFSET / distance
    state[_OFFSET + 2] = min(max(state[_OFFSET + 2], -_MAX_TURN), _MAX_TURN)


@njit
def hold_stance_foot(  # noqa: PLR0913 - a kernel: a foot, its frame and its memory
    footing: Array, limb: int, ahead: float, mixture: float, sole: Array, ground: float, frame: Array, end: Array,
    q: Quat,
) -> None:  # fmt: skip
    """Update the offset of an end, then move and turn the end by it.

    Parameters
    ----------
    footing : Array
        The memory; updated.
    limb : int
        Number of the limb.
    ahead : float
        Step of the hand (`advance_hand`) [rad].
    mixture : float
        μ.
    sole : Array, shape (k, 3)
        Sole points relative to their centre, in the frame of the end [m].
    ground : float
        Height of the ground [m].
    frame : Array, shape (3,)
        Pose over the ground of the frame in which the end is given (x, y [m], heading [rad]).
    end : Array, shape (3,)
        Position of the centre [m]; changed.
    q : Quat
        Orientation of the end; changed.
    """
    state = footing[_ENDS + _END_SIZE * limb : _ENDS + _END_SIZE * (limb + 1)]
    points, cosine, sine = sole.shape[0], np.cos(frame[2]), np.sin(frame[2])
    levers, before = work_array((points, 3)), work_array((points, 3))
    turn = _yaw(frame[2] + state[_OFFSET + 2], q)
    low = _turn_sole(sole, turn, levers)
    x, y = end[0] + state[_OFFSET], end[1] + state[_OFFSET + 1]
    stance = _degree_of_stance(end[2] + low - ground)
    size = (state[_OFFSET] ** 2 + state[_OFFSET + 1] ** 2) / _MAX_OFFSET**2 + (state[_OFFSET + 2] / _MAX_TURN) ** 2
    lifted = 1.0 - 0.5 * (stance + state[_STANCE])
    mixing = state[_MIXING] * np.exp(-(_FADE_RATE * lifted + _ALONE_FADE_RATE * (1.0 - mixture)) * ahead)
    mixing = min(max(mixture, mixing), 1.0)
    hold = stance * mixing * max(1.0 - size, 0.0)
    known = state[_TURN] != 0.0 or state[_TURN + 1] != 0.0 or state[_TURN + 2] != 0.0 or state[_TURN + 3] != 0.0
    if known and abs(ahead) < _MAX_ANGLE_STEP:
        # Mean of the degree of stance before and after the step, so that steps forwards and back cancel.
        share = 0.5 * (hold + state[_HOLD])
        last = state[_TURN], state[_TURN + 1], state[_TURN + 2], state[_TURN + 3]
        low_before = _turn_sole(sole, last, before)
        w, _, _, z = multiply(turn[0], turn[1], turn[2], turn[3], last[0], -last[1], -last[2], -last[3])
        back = -2.0 * share * (np.arctan2(z, w) if w >= 0.0 else np.arctan2(-z, -w))
        slip_x, slip_y = _slip_of_turn(levers, low, before, low_before, back)
        moved_x = slip_x + frame[0] + cosine * x - sine * y - state[_POSITION]
        moved_y = slip_y + frame[1] + sine * x + cosine * y - state[_POSITION + 1]
        state[_OFFSET] -= share * (cosine * moved_x + sine * moved_y)
        state[_OFFSET + 1] -= share * (cosine * moved_y - sine * moved_x)
        state[_OFFSET + 2] += back
        left = np.exp(-(_FADE_RATE * lifted + _ALONE_FADE_RATE * (1.0 - mixing)) * ahead)
        for i in range(3):
            state[_OFFSET + i] *= left
    elif known:
        state[_OFFSET : _OFFSET + 3] = 0.0
    _limit_offset(state)
    end[0] += state[_OFFSET]
    end[1] += state[_OFFSET + 1]
    q[0], q[1], q[2], q[3] = _yaw(state[_OFFSET + 2], q)
    state[_POSITION] = frame[0] + cosine * end[0] - sine * end[1]
    state[_POSITION + 1] = frame[1] + sine * end[0] + cosine * end[1]
    state[_TURN], state[_TURN + 1], state[_TURN + 2], state[_TURN + 3] = _yaw(frame[2], q)
    state[_HOLD], state[_STANCE], state[_MIXING] = hold, stance, mixing
