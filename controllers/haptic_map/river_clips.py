"""Every river plays a clip of its own: the river that has the hand gives the clip, the hand's phase on it the frame."""

import math
from collections.abc import Sequence
from copy import copy

import numpy as np
from numba import njit

from controllers.blending.blend import blend
from controllers.blending.combination import fresh_lap
from controllers.curves.branches import BRANCHES, branches
from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import (
    END,
    START,
    Trajectory,
    curve_acceleration,
    curve_point,
    curve_velocity,
    wrap_phase,
)
from controllers.errors import ParameterError
from controllers.haptic_map.animation import AnimationMap
from controllers.haptic_map.base import CompiledMap
from controllers.legs.limbs import Limb
from controllers.motion.lap import LAP_HEADING, LAP_X, LAP_Y, LAST_ANGLE, MEMORY
from controllers.rotations import multiply
from controllers.state import Array, Pose
from controllers.work_array import work_array

RIVER_CLIPS = 5
# The memory: the lap of the clip that plays, then its river, the last phase on it, and whether it stands still there.
RIVER, PHASE, STILL = MEMORY, MEMORY + 1, MEMORY + 2
# Parameters: a header, offsets of the packed curves and of the phases of rest, both, and the blend.
_RIVERS, _TUBE, _BLEND, _CURVES = range(4)
_RACES = 2.0  # times the river's pace: a hand that no river has and that is faster plays no clip
_SOON = 0.03  # [s] by which it is foreseen that it will be
_NEIGHBOUR = 0.1  # of a lap: a phase further off is another branch


@njit
def _phase_near(params: Array, curve: int, x: Array, last: float) -> float:
    """Phase of the curve's point nearest to the stylus; where it passes twice, of the branch that goes on."""
    found = work_array((BRANCHES, 2))
    start, end = params[curve + START], params[curve + END]
    best, nearest = np.nan, _NEIGHBOUR * (end - start)
    for k in range(branches(params, curve, x[0], x[1], x[2], params[_TUBE], found)):
        away = abs(found[k, 0] - last)
        away = min(away, end - start - away)
        if away < nearest:
            best, nearest = found[k, 0], away
    if np.isnan(best):
        best, _ = closest_phase(params, curve, x[0], x[1], x[2], last)
    return wrap_phase(params, curve, best)


@njit
def river_clips_map(params: Array, x: Array, memory: Array, pose: Pose, jacobian: Array) -> None:
    """Kernel of `RiverClips`: h(x), and h_*(x) unless `jacobian` has no rows."""
    river, rivers = int(memory[RIVER]), int(params[_RIVERS])
    curve = int(params[_CURVES + river])
    phase = memory[PHASE] if memory[STILL] > 0.0 else _phase_near(params, curve, x, memory[PHASE])
    memory[PHASE] = phase
    pace = 2.0 * np.pi / (params[curve + END] - params[curve + START])
    there, along = curve_point(params, curve, phase), curve_velocity(params, curve, phase)
    bend = curve_acceleration(params, curve, phase)
    # The nearest point stays nearest: (φ − p)·φ̇ = 0 gives dt*/dp = φ̇ / (|φ̇|² + (φ − p)·φ̈).
    slope = 0.0
    for i in range(3):
        slope += along[i] ** 2 + (there[i] - x[i]) * bend[i]
    chain = work_array((3, 6))
    chain[:] = 0.0
    for i in range(3):
        chain[0, i] = pace * along[i] / slope if slope > 0.0 and memory[STILL] == 0.0 else 0.0
    weights, changes = work_array((1, rivers)), work_array((1, 3, rivers))
    weights[:], changes[:] = 0.0, 0.0
    weights[0, river] = 1.0
    angle = pace * (phase - params[curve + START])
    blend(params[int(params[_BLEND]) :], angle, weights, changes, chain, memory, pose, jacobian)


@njit(forceinline=False)
def takes_over(params: Array, memory: Array, river: float) -> bool:
    """Whether a river, by its number in the trace of the field, takes the hand from another, or from none; −1 is none.

    What plays another clip, or the clip that stands still, begins at the phase of the hand on that river.
    """
    return 0.0 <= river < params[_RIVERS] and (river != memory[RIVER] or memory[STILL] > 0.0)


@njit(forceinline=False)
def phase_rate(params: Array, memory: Array, later: Array, period: float) -> float:
    """Pace at which the hand plays the clip, 1 for the river's own, by the memory a period later."""
    curve = int(params[_CURVES + int(memory[RIVER])])
    lap, way = params[curve + END] - params[curve + START], later[PHASE] - memory[PHASE]
    return (way - lap * np.round(way / lap)) / period


@njit(forceinline=False)
def lets_go(params: Array, memory: Array, river: float, hand: Array, rate: float) -> bool:
    """Whether no river has the hand any more, and it is outside the tube of the one whose clip plays, or races it.

    A hand (3, 3), with its rates, that is thrown off is not followed until it does: it counts where it will be soon.
    Half way to the curve's centre of curvature its pace is no pace of the river's, too.
    """
    if river >= 0.0 or memory[STILL] > 0.0:
        return False
    curve = int(params[_CURVES + int(memory[RIVER])])
    found, x, v = work_array((BRANCHES, 2)), work_array(3), work_array(3)
    outside = branches(params, curve, hand[0, 0], hand[0, 1], hand[0, 2], params[_TUBE], found) == 0
    if outside or abs(rate) > _RACES:
        return True
    for i in range(3):
        x[i] = hand[0, i] + _SOON * hand[1, i] + 0.5 * _SOON**2 * hand[2, i]
        v[i] = hand[1, i] + _SOON * hand[2, i]
    phase = _phase_near(params, curve, x, memory[PHASE])
    there, along = curve_point(params, curve, phase), curve_velocity(params, curve, phase)
    bend, gain, slope, square = curve_acceleration(params, curve, phase), 0.0, 0.0, 0.0
    for i in range(3):
        gain += v[i] * along[i]
        slope += along[i] ** 2 + (there[i] - x[i]) * bend[i]
        square += along[i] ** 2
    return slope < 0.5 * square or abs(gain) > _RACES * slope


@njit
def change_clip(memory: Array, river: float, phase: float) -> None:
    """Let the clip of another river play, from a phase on, in the frame of the lap that is."""
    memory[RIVER], memory[PHASE], memory[STILL], memory[LAST_ANGLE] = river, phase, 0.0, np.nan


@njit
def stop_clip(params: Array, memory: Array, way: float) -> None:
    """Let the clip that plays stand still wherever the stylus is: at the phase of rest nearest to one `way` ahead."""
    river, rivers = int(memory[RIVER]), int(params[_RIVERS])
    curve = int(params[_CURVES + river])
    lap = params[curve + END] - params[curve + START]
    first, last = int(params[_CURVES + rivers + river]), int(params[_CURVES + rivers + river + 1])
    wanted = wrap_phase(params, curve, memory[PHASE] + way)
    best, nearest = wanted, math.inf
    for k in range(first, last):
        away = abs(params[k] - wanted)
        away = min(away, lap - away)
        if away < nearest:
            best, nearest = params[k], away
    memory[PHASE], memory[STILL], memory[LAST_ANGLE] = best, 1.0, np.nan


@njit
def ahead_in_clip(params: Array, memory: Array, seconds: float) -> None:
    """Go on in the clip that plays at the pace of its river, without the hand; one that stands still stands."""
    if memory[STILL] == 0.0:
        curve = int(params[_CURVES + int(memory[RIVER])])
        memory[PHASE], memory[STILL] = wrap_phase(params, curve, memory[PHASE] + seconds), 1.0


@njit
def heading_between(pose: Pose, other: Pose) -> float:
    """Angle about the vertical [rad] by which a root must turn to face as another one does: the twist of q' q⁻¹."""
    w, _, _, z = multiply(other[3], other[4], other[5], other[6], pose[3], -pose[4], -pose[5], -pose[6])
    return 2.0 * np.arctan2(z, w) if w >= 0.0 else 2.0 * np.arctan2(-z, -w)


@njit
def place_clip(memory: Array, pose: Pose, x: float, y: float, turn: float) -> None:
    """Move the lap's frame such that the figure, now in a pose, stands at (x, y) [m], turned by an angle [rad]."""
    cosine, sine = np.cos(turn), np.sin(turn)
    away_x, away_y = memory[LAP_X] - pose[0], memory[LAP_Y] - pose[1]
    memory[LAP_X] = x + cosine * away_x - sine * away_y
    memory[LAP_Y] = y + sine * away_x + cosine * away_y
    memory[LAP_HEADING] += turn


class RiverClips(AnimationMap):
    r"""One clip for each river of a bundle.

    .. math:: h(p, i) = A\,\rho_i\bigl(2\pi\,(t^*_i - t_0)/(t_1 - t_0)\bigr)

    i is the river that has the hand, a number that the field leaves in its trace; t*_i the phase of its curve nearest
    to the stylus (of the branch that goes on, where the curve passes twice); a lap of the river is a lap of its clip.
    A hand that no river has, outside the tube of the last or too fast in it, has no frame: the reference stops, at a
    phase at which the clip can stand (`stop_clip`).
    Clips are aligned in time to the first (`alignment`), so at a change the figure is about as far in the new motion
    as it was in the old. A ∈ SE(2) is the frame of the lap, kept in the memory (`lap`). When the river changes, h
    jumps: the reference goes on from where the figure stands (`place_clip`), with the offset decaying
    (`inertialization`). h does not depend on the stylus's orientation.

    Parameters
    ----------
    curves : sequence of Trajectory
        Of the rivers, periodic, in H.
    clips : sequence of (Array, float)
        As many: poses (n, nq) and frames per second. Clips that do not close are closed (`closed_loop`).
    tube : float
        Distance from a curve [m] within which a branch is followed; beyond it the nearest point of all counts.
    limbs : sequence of Limb
        Limbs whose ends are placed: feet that stand (see `limbs`).
    lap : float, optional
        Time of the hand's lap [s], in which each clip is played as often as it fits (`strides`); without it, once.
    apart : bool
        Whether strides of the clips need not be in step.

    Raises
    ------
    ParameterError
        If there are not as many clips as curves, a curve is open, the tube is not positive, or a clip is not as the
        others.
    """

    def __init__(
        self,
        curves: Sequence[Trajectory],
        clips: Sequence[tuple[Array, float]],
        tube: float,
        limbs: Sequence[Limb] = (),
        lap: float | None = None,
        apart: bool = False,
    ) -> None:
        if len(clips) != len(curves) or not curves:
            raise ParameterError(
                f"a map of rivers wants a clip for each; got {len(clips)} clips and {len(curves)} rivers"
            )
        opened = [i for i, curve in enumerate(curves) if not curve.periodic]
        if opened:
            raise ParameterError(f"a river that plays a clip must be a closed curve; river {opened[0]} is open")
        if not tube > 0.0:
            raise ParameterError(f"the tube of a map of rivers must be positive, got {tube} m")
        self.curves, self._tube = tuple(curves), tube
        super().__init__(RIVER_CLIPS, river_clips_map, clips, self._header([np.zeros(0)] * len(curves)), (), limbs, lap,
                         apart)  # fmt: skip

    def _header(self, rests: Sequence[Array]) -> Array:
        """What the kernel reads before the blend."""
        blocks = [*(curve.packed() for curve in self.curves), *rests]
        offsets = np.cumsum([_CURVES + len(blocks) + 1, *(len(block) for block in blocks)])
        return np.concatenate([[len(self.curves), self._tube, offsets[-1]], offsets, *blocks])

    def with_rests(self, rests: Sequence[Array]) -> "RiverClips":
        """The same map, whose clips stop only where they can stand: phases of each curve, shape (n,); none: anywhere.

        Raises
        ------
        ParameterError
            If there are not phases for as many curves, or they are not finite.
        """
        phases = [np.asarray(still, dtype=np.float64).ravel() for still in rests]
        if len(phases) != len(self.curves) or not all(np.all(np.isfinite(still)) for still in phases):
            raise ParameterError(f"expected finite phases of rest for each of {len(self.curves)} rivers, got {rests}")
        other = copy(self)
        other._params = np.concatenate([self._header(phases), self._params[int(self._params[_BLEND]) :]])
        return other

    def compiled(self) -> CompiledMap:
        """The map as its kernel takes it, with the memory of a new run: the first river has the hand."""
        return CompiledMap(self._kind, self._params, np.concatenate([fresh_lap(), [0.0, np.nan, 0.0]]))
