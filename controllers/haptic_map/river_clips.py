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
# The memory: the lap of the clip that plays, then its river, the last phase of the hand, and whether it stands still
# there; the river along which the hand goes, the phase at which it came there, how far the clip was ahead of it, and
# the phase that is shown; the change that is gone through (−1: none), its gate, and the phase that was shown when gates
# were looked for last.
RIVER, PHASE, STILL, COURSE, CAME, AHEAD, SHOWN, CHANGE, GATE, LOOKED = range(MEMORY, MEMORY + 10)
# Parameters: a header, offsets of the packed curves, the phases of rest and the changes, all these, and the blend.
_RIVERS, _TUBE, _BLEND, _CURVES = range(4)
_RACES = 2.0  # times the river's pace: a hand that no river has and that is faster plays no clip
_SOON = 0.03  # [s] by which it is foreseen that it will be
_CATCHES_UP = 2.0  # [s] in which a clip comes to be with a hand that it was ahead of
_PAST = 0.25  # of a lap: a hand that goes back by as much is no longer before the moment, but after it
LONGEST = 0.7  # of a lap, that a change may last
_ALIKE = 1e-6  # [s] by which laps of rivers differ at most
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
    # The nearest point stays nearest: (φ − p)·φ̇ = 0 gives dt*/dp = φ̇ / (|φ̇|² + (φ − p)·φ̈).
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
    """Where the curve along which the hand goes is."""
    return int(params[_CURVES + int(memory[COURSE])])


@njit
def changes_of(params: Array) -> Array:
    """The changes that a map knows (`packed_changes`)."""
    return params[int(params[_CURVES + 2 * int(params[_RIVERS])]) :]


@njit
def _after(phase: float, moment: float, lap: float) -> float:
    """How long a phase is after a moment of the lap [s]; up to a quarter of it before, that is negative."""
    way = phase - moment
    return way - lap * np.floor(way / lap + _PAST)


@njit(forceinline=False)
def takes_over(params: Array, memory: Array, river: float) -> bool:
    """Whether a river, by its number in the trace of the field, takes the hand from another, or from none; −1 is none.

    What plays another clip, or the clip that stands still, begins at the phase of the hand on that river.
    """
    other = river != memory[RIVER] or river != memory[COURSE]
    return 0.0 <= river < params[_RIVERS] and (other or memory[STILL] > 0.0)


@njit(forceinline=False)
def phase_rate(params: Array, memory: Array, later: Array, period: float) -> float:
    """Pace at which the hand plays the clip, 1 for the river's own, by the memory a period later."""
    curve = _course(params, memory)
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
    """Let the clip of another river play, from a phase on, in the frame of the lap that is."""
    memory[RIVER], memory[PHASE], memory[STILL], memory[LAST_ANGLE] = river, phase, 0.0, np.nan
    memory[COURSE], memory[AHEAD], memory[SHOWN], memory[CHANGE] = river, 0.0, phase, -1.0


@njit(forceinline=False)
def knows_change(params: Array, memory: Array, river: float) -> bool:
    """Whether a change from the clip that plays to a river's is known, or is none."""
    if memory[STILL] > 0.0:
        return False
    return river == memory[RIVER] or known_between(changes_of(params), memory[RIVER], river)


@njit(forceinline=False)
def gate_passed(params: Array, memory: Array, river: float) -> tuple[int, float]:
    """Change to a river, by its number, whose gate [s] has been passed since the last call; −1 if it has none."""
    curve, before = _course(params, memory), memory[LOOKED]
    memory[LOOKED] = memory[SHOWN]
    start, lap = params[curve + START], params[curve + END] - params[curve + START]
    return gate_behind(changes_of(params), memory[RIVER], river, before - start, memory[SHOWN] - start, lap)


@njit(forceinline=False)
def changing(memory: Array) -> bool:
    """Whether a known change is gone through."""
    return bool(memory[CHANGE] >= 0.0)


@njit
def take_course(params: Array, memory: Array, river: float, x: Array, shown: float) -> None:
    """Let the hand at x be timed by another river's curve, while the clip that plays shows a phase [s]."""
    memory[COURSE] = river
    curve = _course(params, memory)
    phase = _phase_near(params, curve, x, shown)
    lap, away = params[curve + END] - params[curve + START], shown - phase
    memory[PHASE], memory[CAME], memory[AHEAD] = phase, phase, away - lap * np.round(away / lap)


@njit
def hold_at_gate(params: Array, memory: Array, gate: float) -> None:
    """Let the clip that plays stand where it has a gate [s]."""
    memory[PHASE] = params[_course(params, memory) + START] + gate
    memory[STILL], memory[AHEAD] = 1.0, 0.0


@njit
def begin_change(memory: Array, river: float, change: int, gate: float) -> None:
    """Let the clip of another river play through a known change, from its gate [s] on."""
    memory[RIVER], memory[LAST_ANGLE], memory[CHANGE], memory[GATE] = river, np.nan, change, gate


@njit
def go_on(memory: Array, phase: float, ahead: float) -> None:
    """Let a clip that was held go on with the hand, at a phase, and ahead of it by a time [s]."""
    memory[PHASE], memory[AHEAD], memory[STILL] = phase, ahead, 0.0


@njit
def stop_clip(params: Array, memory: Array, way: float) -> None:
    """Let the clip that plays stand still wherever the stylus is: at the phase of rest nearest to one `way` ahead."""
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
    """Go on in the clip that plays at the pace of its river, without the hand; one that stands still stands."""
    if memory[STILL] == 0.0:
        memory[PHASE], memory[STILL] = wrap_phase(params, _course(params, memory), memory[PHASE] + seconds), 1.0


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
    (`inertialization`); or, where a change from the one clip to the other is known (`clip_change`), it begins at the
    next gate, and h goes through it with the phase of the hand. h does not depend on the stylus's orientation.

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
        self._rests: tuple[Array, ...] = (np.zeros(0),) * len(curves)
        self.changes: tuple[ClipChange, ...] = ()
        super().__init__(RIVER_CLIPS, river_clips_map, clips, self._header(), (), limbs, lap, apart)

    def _header(self) -> Array:
        """What the kernel reads before the blend."""
        blocks = [*(curve.packed() for curve in self.curves), *self._rests, packed_changes(self.changes)]
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
        other._rests = tuple(phases)
        return other._repacked()

    def with_changes(self, changes: Sequence[ClipChange]) -> "RiverClips":
        """The same map, whose clips go over into each other by changes that are known, where there are.

        Raises
        ------
        ParameterError
            If one is between rivers that are not there or whose laps differ, has no gate, is not of such poses, or
            lasts longer than 0.7 of a lap.
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
        """The same clips with the first river's curve for all: between them then only the motion changes."""
        other = copy(self)
        other.curves = (self.curves[0],) * len(self.curves)
        return other._repacked()

    def _repacked(self) -> "RiverClips":
        self._params = np.concatenate([self._header(), self._params[int(self._params[_BLEND]) :]])
        return self

    def compiled(self) -> CompiledMap:
        """The map as its kernel takes it, with the memory of a new run: the first river has the hand."""
        memory = [0.0, np.nan, 0.0, 0.0, 0.0, 0.0, np.nan, -1.0, 0.0, np.nan]
        return CompiledMap(self._kind, self._params, np.concatenate([fresh_lap(), memory]))
