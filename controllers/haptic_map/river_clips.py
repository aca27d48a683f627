"""The map of a bundle of rivers: the active river selects the clip, the hand's phase on its curve the frame."""

import math
from collections.abc import Sequence
from copy import copy

import numpy as np
from numba import njit

from controllers.blending.blend import blend
from controllers.blending.combination import fresh_lap
from controllers.curves.branches import BRANCHES, SAME_BRANCH, branches
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
from controllers.easing import smooth_step
from controllers.errors import ParameterError
from controllers.haptic_map.animation import AnimationMap
from controllers.haptic_map.base import CompiledMap
from controllers.haptic_map.clip_change import (
    ClipChange,
    add_change,
    change_lasts,
    gate_behind,
    known_between,
    packed_changes,
)
from controllers.legs.limbs import Limb
from controllers.motion.lap import LAP_HEADING, LAP_X, LAP_Y, LAST_ANGLE, MEMORY
from controllers.rotations import multiply
from controllers.state import Array, Pose
from controllers.work_array import work_array

RIVER_CLIPS = 5
# Memory behind the frame of the lap; phases in s:
# RIVER: river of the playing clip. PHASE: last phase of the hand. STILL: 1 while the clip is held at a phase.
# COURSE: river whose curve times the hand. CAME: phase at which the hand came to it. AHEAD: lead of the clip over the
# hand at that moment. SHOWN: phase that is shown. CHANGE: change in progress (−1: none). GATE: its gate. LOOKED: phase
# shown when gates were last searched.
RIVER, PHASE, STILL, COURSE, CAME, AHEAD, SHOWN, CHANGE, GATE, LOOKED = range(MEMORY, MEMORY + 10)
# Parameters: header, offsets of the packed curves, of the rest phases and of the changes, then these, then the blend.
_RIVERS, _TUBE, _BLEND, _CURVES = range(4)
_RACES = 2.0  # times the river's pace: a faster hand that no river holds plays no clip
_SOON = 0.03  # [s] horizon of the prediction in `lets_go`: followed until it races the clip, a root leaps by 3.7 m/s
_CATCHES_UP = 2.0  # [s] of the phase, in which the clip's lead over the hand decays to zero
_PAST = 0.25  # of a lap: a phase that lies before a moment by less than this counts as before it, otherwise as after it
LONGEST = 0.7  # of a lap: longest duration of a change
_ALIKE = 1e-6  # [s] largest difference of the laps of two rivers with a change between them


@njit
def _phase_near(params: Array, curve: int, x: Array, last: float) -> float:
    """Phase [s] of the curve's point nearest to the stylus; of several branches, that which continues `last`."""
    found = work_array((BRANCHES, 2))
    start, end = params[curve + START], params[curve + END]
    best, nearest = np.nan, SAME_BRANCH * (end - start)
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
    curve = _course(params, memory)
    phase = memory[PHASE] if memory[STILL] > 0.0 else _phase_near(params, curve, x, memory[PHASE])
    start, lap = params[curve + START], params[curve + END] - params[curve + START]
    pace, rate, shown = 2.0 * np.pi / lap, 1.0, phase
    memory[PHASE] = phase
    if memory[AHEAD] != 0.0:
        went = min(max(_after(phase, memory[CAME], lap) / _CATCHES_UP, 0.0), 1.0)
        shown = wrap_phase(params, curve, phase + memory[AHEAD] * (1.0 - smooth_step(went)))
        rate -= memory[AHEAD] * 30.0 * (went * (1.0 - went)) ** 2 / _CATCHES_UP
        memory[AHEAD] = memory[AHEAD] if went < 1.0 else 0.0
    memory[SHOWN] = shown
    known, change, since = changes_of(params), int(memory[CHANGE]), 0.0
    if change >= 0:
        since = _after(shown - start, memory[GATE], lap)
        memory[CHANGE] = memory[CHANGE] if since < change_lasts(known, change) else -1.0
    there, along = curve_point(params, curve, phase), curve_velocity(params, curve, phase)
    bend = curve_acceleration(params, curve, phase)
    # Differentiating (φ − p)·φ̇ = 0 at the nearest point gives dt*/dp = φ̇ / (|φ̇|² + (φ − p)·φ̈).
    slope = 0.0
    for i in range(3):
        slope += along[i] ** 2 + (there[i] - x[i]) * bend[i]
    chain = work_array((3, 6))
    chain[:] = 0.0
    for i in range(3):
        chain[0, i] = rate * pace * along[i] / slope if slope > 0.0 and memory[STILL] == 0.0 else 0.0
    weights, changes = work_array((1, rivers)), work_array((1, 3, rivers))
    weights[:], changes[:] = 0.0, 0.0
    weights[0, river] = 1.0
    angle = pace * (shown - start)
    blend(params[int(params[_BLEND]) :], angle, weights, changes, chain, memory, pose, jacobian)
    if change >= 0:
        for i in range(6):
            chain[0, i] /= pace
        add_change(known, change, since, chain[0], pose, jacobian)


@njit
def _course(params: Array, memory: Array) -> int:
    """Offset in the parameters of the curve that times the hand."""
    return int(params[_CURVES + int(memory[COURSE])])


@njit
def changes_of(params: Array) -> Array:
    """The precomputed changes of a map (`packed_changes`)."""
    return params[int(params[_CURVES + 2 * int(params[_RIVERS])]) :]


@njit
def _after(phase: float, moment: float, lap: float) -> float:
    """Time of a phase after a moment of the lap [s]; negative up to a quarter of the lap before it."""
    way = phase - moment
    return way - lap * np.floor(way / lap + _PAST)


@njit
def takes_over(params: Array, memory: Array, river: float) -> bool:
    """Whether the active river of the field (−1: none) takes the hand over from another river, or a held clip goes on.

    The clip then begins at the phase of the hand on that river.
    """
    other = river != memory[RIVER] or river != memory[COURSE]
    return 0.0 <= river < params[_RIVERS] and (other or memory[STILL] > 0.0)


@njit
def phase_rate(params: Array, memory: Array, later: Array, period: float) -> float:
    """Pace at which the hand plays the clip, 1 for the river's own, from the memory `later`, one `period` [s] on."""
    curve = _course(params, memory)
    lap, way = params[curve + END] - params[curve + START], later[PHASE] - memory[PHASE]
    return (way - lap * np.round(way / lap)) / period


@njit
def lets_go(params: Array, memory: Array, river: float, hand: Array, rate: float) -> bool:
    """Whether the hand has left the river of the playing clip: no river is active, and it is off the tube or too fast.

    `hand` (3, 3) holds position, velocity and acceleration. So that the clip does not follow a hand that is thrown off,
    the pace predicted `_SOON` ahead counts too; and so does a predicted place more than half way to the curve's centre
    of curvature, where the phase is not a useful measure of pace.
    """
    if river >= 0.0 or memory[STILL] > 0.0:
        return False
    curve = _course(params, memory)
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
    """Play the clip of another river, from a phase [s] on, in the current frame of the lap."""
    memory[RIVER], memory[PHASE], memory[STILL], memory[LAST_ANGLE] = river, phase, 0.0, np.nan
    memory[COURSE], memory[AHEAD], memory[SHOWN], memory[CHANGE] = river, 0.0, phase, -1.0


@njit
def knows_change(params: Array, memory: Array, river: float) -> bool:
    """Whether a precomputed change leads from the playing clip to that of a river, or the river is already playing."""
    if memory[STILL] > 0.0:
        return False
    return river == memory[RIVER] or known_between(changes_of(params), memory[RIVER], river)


@njit
def gate_passed(params: Array, memory: Array, river: float) -> tuple[int, float]:
    """Number and gate [s] of a change to a river whose gate was passed since the last call; number −1 if none was."""
    curve, before = _course(params, memory), memory[LOOKED]
    memory[LOOKED] = memory[SHOWN]
    start, lap = params[curve + START], params[curve + END] - params[curve + START]
    return gate_behind(changes_of(params), memory[RIVER], river, before - start, memory[SHOWN] - start, lap)


@njit
def changing(memory: Array) -> bool:
    """Whether a precomputed change is in progress."""
    return bool(memory[CHANGE] >= 0.0)


@njit
def take_course(params: Array, memory: Array, river: float, x: Array, shown: float) -> None:
    """Time the hand at x by another river's curve, while the playing clip shows the phase `shown` [s]."""
    memory[COURSE] = river
    curve = _course(params, memory)
    phase = _phase_near(params, curve, x, shown)
    lap, away = params[curve + END] - params[curve + START], shown - phase
    memory[PHASE], memory[CAME], memory[AHEAD] = phase, phase, away - lap * np.round(away / lap)


@njit
def hold_at_gate(params: Array, memory: Array, gate: float) -> None:
    """Hold the playing clip at a gate [s]."""
    memory[PHASE] = params[_course(params, memory) + START] + gate
    memory[STILL], memory[AHEAD] = 1.0, 0.0


@njit
def begin_change(memory: Array, river: float, change: int, gate: float) -> None:
    """Play the clip of another river through a precomputed change, from its gate [s] on."""
    memory[RIVER], memory[LAST_ANGLE], memory[CHANGE], memory[GATE] = river, np.nan, change, gate


@njit
def go_on(memory: Array, phase: float, ahead: float) -> None:
    """Let a held clip go on with the hand at a phase [s], ahead of the hand by a time [s]."""
    memory[PHASE], memory[AHEAD], memory[STILL] = phase, ahead, 0.0


@njit
def stop_clip(params: Array, memory: Array, way: float) -> None:
    """Hold the playing clip at the rest phase nearest to `way` [s] beyond the shown phase; without any, just there."""
    river, rivers, curve = int(memory[RIVER]), int(params[_RIVERS]), _course(params, memory)
    lap = params[curve + END] - params[curve + START]
    first, last = int(params[_CURVES + rivers + river]), int(params[_CURVES + rivers + river + 1])
    wanted = wrap_phase(params, curve, memory[SHOWN] + way)
    best, nearest = wanted, math.inf
    for k in range(first, last):
        away = abs(params[k] - wanted)
        away = min(away, lap - away)
        if away < nearest:
            best, nearest = params[k], away
    memory[PHASE], memory[STILL], memory[LAST_ANGLE] = best, 1.0, np.nan
    memory[AHEAD], memory[CHANGE] = 0.0, -1.0


@njit
def ahead_in_clip(params: Array, memory: Array, seconds: float) -> None:
    """Advance the playing clip by `seconds` at its river's own pace and hold it there; a held clip stays."""
    if memory[STILL] == 0.0:
        memory[PHASE], memory[STILL] = wrap_phase(params, _course(params, memory), memory[PHASE] + seconds), 1.0


@njit
def heading_between(pose: Pose, other: Pose) -> float:
    """Angle about the vertical [rad] from the heading of one pose's root to that of another: the twist of q' q⁻¹."""
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

    i is the active river, whose number the field leaves in its trace; t*_i the phase of its curve nearest to the stylus
    (of several branches, of the one that continues); a lap of the river is a lap of its clip. A hand without an active
    river that is outside the tube of the last one, or too fast in it, plays no frame: the reference stops at a phase at
    which the clip can stand (`stop_clip`).

    Clips are aligned in time to the first (`alignment`), so that a change keeps about the same phase of motion. A ∈
    SE(2) is the frame of the lap, kept in the memory (`lap`). When the river changes, h jumps, and the reference goes
    on from where the figure stands (`place_clip`) with a decaying offset (`inertialization`). Where a change between
    the two clips is precomputed (`clip_change`), it begins at the next gate instead, and h runs through it with the
    phase of the hand. h does not depend on the stylus's orientation.

    Parameters
    ----------
    curves : sequence of Trajectory
        Curves of the rivers, periodic, in H.
    clips : sequence of (Array, float)
        One for each curve: poses (n, nq) and frames per second. Clips that do not close are closed (`closed_loop`).
    tube : float
        Distance from a curve [m] within which a branch is followed; beyond it the nearest point of all counts.
    limbs : sequence of Limb
        Limbs whose ends (feet) are placed (see `limbs`).
    lap : float, optional
        Duration of the hand's lap [s], in which each clip is played as often as it fits (`strides`); by default once.
    apart : bool
        Whether strides of the clips need not be in step.

    Raises
    ------
    ParameterError
        If clips and curves differ in number, a curve is open, the tube is not positive, or the clips' poses differ in
        size.
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
        self._rests: tuple[Array, ...] = (np.zeros(0),) * len(curves)
        self.changes: tuple[ClipChange, ...] = ()
        super().__init__(RIVER_CLIPS, river_clips_map, clips, self._header(), (), limbs, lap, apart)

    def _header(self) -> Array:
        """Parameters of the kernel before those of the blend."""
        blocks = [*(curve.packed() for curve in self.curves), *self._rests, packed_changes(self.changes)]
        offsets = np.cumsum([_CURVES + len(blocks) + 1, *(len(block) for block in blocks)])
        return np.concatenate([[len(self.curves), self._tube, offsets[-1]], offsets, *blocks])

    def with_rests(self, rests: Sequence[Array]) -> "RiverClips":
        """The same map with clips that stop only at rest phases [s], shape (n,) for each curve; empty: anywhere.

        Raises
        ------
        ParameterError
            If phases and curves differ in number, or a phase is not finite.
        """
        phases = [np.asarray(still, dtype=np.float64).ravel() for still in rests]
        if len(phases) != len(self.curves) or not all(np.all(np.isfinite(still)) for still in phases):
            raise ParameterError(f"expected finite phases of rest for each of {len(self.curves)} rivers, got {rests}")
        other = copy(self)
        other._rests = tuple(phases)
        return other._repacked()

    def with_changes(self, changes: Sequence[ClipChange]) -> "RiverClips":
        """The same map with precomputed changes between its clips.

        Raises
        ------
        ParameterError
            If a change names a river that does not exist, or rivers with different laps, has no gate, does not fit
            the poses, or lasts longer than 0.7 of a lap.
        """
        laps = [curve.duration for curve in self.curves]
        for change in changes:
            told = f"the change from river {change.first} to {change.second}"
            if not {change.first, change.second} <= set(range(len(laps))) or change.first == change.second:
                raise ParameterError(f"{told} is not between two of {len(laps)} rivers")
            if abs(laps[change.first] - laps[change.second]) > _ALIKE:
                raise ParameterError(f"{told} is between laps of {laps[change.first]} and {laps[change.second]} s")
            if not len(change.gates) or change.offsets.shape[1:] != (3 + 3 * ((self.nq - 3) // 4),):
                raise ParameterError(f"{told} has {len(change.gates)} gates and offsets {change.offsets.shape}")
            if not 0.0 < change.seconds < LONGEST * laps[change.first]:
                raise ParameterError(f"{told} lasts {change.seconds:.2f} s of a lap of {laps[change.first]:.2f} s")
        other = copy(self)
        other.changes = tuple(changes)
        return other._repacked()

    def on_one_river(self) -> "RiverClips":
        """The same clips with the first river's curve for all, so that a change affects only the motion."""
        other = copy(self)
        other.curves = (self.curves[0],) * len(self.curves)
        return other._repacked()

    def _repacked(self) -> "RiverClips":
        self._params = np.concatenate([self._header(), self._params[int(self._params[_BLEND]) :]])
        return self

    def compiled(self) -> CompiledMap:
        """The map in the form of its kernel, with the memory of a new run: the first river is active."""
        memory = [0.0, np.nan, 0.0, 0.0, 0.0, 0.0, np.nan, -1.0, 0.0, np.nan]
        return CompiledMap(self._kind, self._params, np.concatenate([fresh_lap(), memory]))
