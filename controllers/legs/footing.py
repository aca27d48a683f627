r"""Run-time removal of foot skate: feet in stance keep their place on the floor while the hand changes the blend.

The corrections of a mixture (`pair_corrections`) hold a foot only while the mixture is constant. Where the hand changes
the mixture, and with it the foot's mean position, or between the mixtures that were corrected, the foot would slide. So
each end has an offset o over the ground, kept in the memory. It cancels the share σ, the degree of stance, of the slip
Δp of the end's touching points, and fades as the end swings through the air,

.. math:: o \leftarrow o - \sigma\,\Delta p, \qquad \frac{do}{d\theta} = -\kappa\,(1 - \sigma_0)\, o .

σ = σ₀(h) μ(w) falls with the height h of the sole, and to 0 where a clip is alone: a clip keeps its own foot skate, so
that h∘α̃ = α. Headings likewise. While a hand moves back a little, the offset grows again, until the direction counts
as reversed; so velocity and acceleration of the figure may be taken as differences to either side. h_* is the
derivative at a given offset.
"""

from collections.abc import Sequence

import numpy as np
from numba import njit

from controllers.easing import smooth_step
from controllers.errors import ParameterError
from controllers.legs.limbs import Limb
from controllers.legs.sole_heights import STANDS
from controllers.rotations import multiply, rotate
from controllers.state import Array, Quat
from controllers.work_array import work_array

# [m] height of the sole from which σ₀ is 0; up to `STANDS` it is 1. The example at `_MOST` slides 0.3 cm, with 4.5 mm
# 0.6, with 8 mm, from which a sole swings elsewhere, 0.4 and with 12 mm 0.9.
_SWING_HEIGHT = 0.006
_MIXED, _ALONE = 0.6, 0.97  # Σ w² from which μ falls, and where it is 0: of two clips, weights 0.72 and 0.985
# κ [1/rad], and the additional rate where a clip is alone: half or twice of κ leaves the slide of the example at
# `_MOST` at 0.3 cm.
_FADE, _FADE_ALONE = 5.0, 1.0
# [m], [rad] largest offset: a hand that goes round among walk, run, jump and angry once a lap makes feet slide 5.8 cm
# without footing, 0.3 with it, 0.9 with half of the first and 0.2 with twice.
_MOST, _MOST_TURN = 0.15, 0.8
_CONTACT_SCALE = 1e-3  # [m] scale of heights in the weights of the touching points
_TURNED = 0.15  # [rad] way back after which the hand's direction counts as reversed
_JUMP = 1.0  # [rad] larger than any step of the hand's angle in one tick
_WAY, _BEHIND, _ANGLE, _ENDS = range(4)
_OFFSET, _PLACE, _TURN, _HELD, _STOOD, _END = 0, 3, 5, 9, 10, 11


def fresh_footing(limbs: int) -> Array:
    """Memory of the footing of a number of limbs at the start of a run."""
    memory = np.zeros(_ENDS + _END * limbs)
    memory[_WAY], memory[_ANGLE] = 1.0, np.nan
    return memory


def packed_soles(limbs: Sequence[Limb]) -> Array:
    """Sole points of limbs, relative to their centre [m], packed one after the other for `keep_footing`.

    Raises
    ------
    ParameterError
        If the limbs differ in their number of points.
    """
    if len({len(limb.points) for limb in limbs}) > 1:
        raise ParameterError(f"limbs must have equally many points, got {[len(limb.points) for limb in limbs]}")
    return np.concatenate([np.zeros(0), *((limb.points - limb.points.mean(axis=0)).ravel() for limb in limbs)])


@njit
def _step_down(x: float, low: float, high: float) -> float:
    """C² step from 1 at `low` to 0 at `high`."""
    return smooth_step((high - x) / (high - low))


@njit
def go_on(footing: Array, angle: float) -> float:
    """Store the angle of the hand; returns its step [rad] in the hand's current direction, negative if backwards."""
    step = angle - footing[_ANGLE]
    footing[_ANGLE] = angle
    if not np.isfinite(step):
        return 0.0
    step -= 2.0 * np.pi * np.round(step / (2.0 * np.pi))
    ahead = footing[_WAY] * step
    footing[_BEHIND] = max(footing[_BEHIND] - ahead, 0.0)
    if footing[_BEHIND] > _TURNED:
        footing[_WAY], footing[_BEHIND] = -footing[_WAY], 0.0
    return ahead


@njit
def mixed(weights: Array) -> float:
    """μ of weights (m,): 1 for a mixture, 0 for a clip alone."""
    square = 0.0
    for w in weights:
        square += w * w
    return _step_down(square, _MIXED, _ALONE)


@njit
def _levers(sole: Array, q: tuple[float, float, float, float], levers: Array) -> float:
    """Write the points of a sole (k, 3) turned by q; returns the height of the lowest."""
    least = np.inf
    for i in range(sole.shape[0]):
        x, y, z = rotate(q[0], q[1], q[2], q[3], sole[i, 0], sole[i, 1], sole[i, 2])
        levers[i, 0], levers[i, 1], levers[i, 2] = x, y, z
        least = min(least, z)
    return least


@njit
def _yawed(angle: float, q: Array) -> tuple[float, float, float, float]:
    return multiply(np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle), q[0], q[1], q[2], q[3])


@njit
def keep_footing(  # noqa: PLR0913 - a kernel: a foot, its frame and its memory
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
        Step of the hand (`go_on`) [rad].
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
    state = footing[_ENDS + _END * limb : _ENDS + _END * (limb + 1)]
    points, cosine, sine = sole.shape[0], np.cos(frame[2]), np.sin(frame[2])
    levers, before = work_array((points, 3)), work_array((points, 3))
    turn = _yawed(frame[2] + state[_OFFSET + 2], q)
    low = _levers(sole, turn, levers)
    x, y = end[0] + state[_OFFSET], end[1] + state[_OFFSET + 1]
    stands = _step_down(end[2] + low - ground, STANDS, _SWING_HEIGHT)
    size = (state[_OFFSET] ** 2 + state[_OFFSET + 1] ** 2) / _MOST**2 + (state[_OFFSET + 2] / _MOST_TURN) ** 2
    held = stands * mixture * max(1.0 - size, 0.0)
    known = state[_TURN] != 0.0 or state[_TURN + 1] != 0.0 or state[_TURN + 2] != 0.0 or state[_TURN + 3] != 0.0
    if known and abs(ahead) < _JUMP:
        # Mean of the degree of stance before and after the step, so that steps forwards and back cancel.
        share = 0.5 * (held + state[_HELD])
        last = state[_TURN], state[_TURN + 1], state[_TURN + 2], state[_TURN + 3]
        low_before = _levers(sole, last, before)
        w, _, _, z = multiply(turn[0], turn[1], turn[2], turn[3], last[0], -last[1], -last[2], -last[3])
        back = -2.0 * share * (np.arctan2(z, w) if w >= 0.0 else np.arctan2(-z, -w))
        turned_c, turned_s = np.cos(back), np.sin(back)
        total, moved_x, moved_y = 0.0, 0.0, 0.0
        for i in range(points):
            touch = np.exp((low - levers[i, 2]) / _CONTACT_SCALE) + np.exp((low_before - before[i, 2]) / _CONTACT_SCALE)
            moved_x += touch * (turned_c * levers[i, 0] - turned_s * levers[i, 1] - before[i, 0])
            moved_y += touch * (turned_s * levers[i, 0] + turned_c * levers[i, 1] - before[i, 1])
            total += touch
        moved_x = moved_x / total + frame[0] + cosine * x - sine * y - state[_PLACE]
        moved_y = moved_y / total + frame[1] + sine * x + cosine * y - state[_PLACE + 1]
        state[_OFFSET] -= share * (cosine * moved_x + sine * moved_y)
        state[_OFFSET + 1] -= share * (cosine * moved_y - sine * moved_x)
        state[_OFFSET + 2] += back
        fade = _FADE * (1.0 - 0.5 * (stands + state[_STOOD])) + _FADE_ALONE * (1.0 - mixture)
        left = np.exp(-fade * ahead)
        for i in range(3):
            state[_OFFSET + i] *= left
    elif known:
        state[_OFFSET : _OFFSET + 3] = 0.0
    way = np.sqrt(state[_OFFSET] ** 2 + state[_OFFSET + 1] ** 2)
    if way > _MOST:
        state[_OFFSET] *= _MOST / way
        state[_OFFSET + 1] *= _MOST / way
    state[_OFFSET + 2] = min(max(state[_OFFSET + 2], -_MOST_TURN), _MOST_TURN)
    end[0] += state[_OFFSET]
    end[1] += state[_OFFSET + 1]
    q[0], q[1], q[2], q[3] = _yawed(state[_OFFSET + 2], q)
    state[_PLACE] = frame[0] + cosine * end[0] - sine * end[1]
    state[_PLACE + 1] = frame[1] + sine * end[0] + cosine * end[1]
    state[_TURN], state[_TURN + 1], state[_TURN + 2], state[_TURN + 3] = _yawed(frame[2], q)
    state[_HELD], state[_STOOD] = held, stands
