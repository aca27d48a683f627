"""Memory of the map of a bundle of rivers: the clip that is playing, its phase, and the change to another clip.

Clips whose durations have no short lap in common are played in a round of several laps: the map is then a function on
the covering of the curves by that many laps, and the memory stores which of them the hand is in.
"""

import math

import numpy as np
from numba import njit

from controllers.curves.branches import BRANCHES, SAME_BRANCH, branches
from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import END, START, curve_acceleration, curve_point, curve_velocity, wrap_phase
from controllers.haptic_map.clip_change import known_between, passed_gate
from controllers.motion.lap import LAP_HEADING, LAP_X, LAP_Y, LAST_ANGLE, MEMORY
from controllers.state import Pose
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.easing import smooth_step, smooth_step_slope
from geometry.rotations import multiply

# Memory after the frame of the lap; phases are those of the round [s].
# ACTIVE_RIVER: river of the clip that is playing. HAND_PHASE: last phase of the hand. HELD: 1 while the clip is held at
# a phase. TIMING_RIVER: river whose curve gives the phase of the hand. ENTRY_PHASE: phase at which the hand came to it.
# LEAD: lead of the clip over the hand at that moment. CLIP_PHASE: phase that is shown. TRANSITION: change in progress
# (−1: none). GATE_PHASE: its gate. LAST_SEARCH_PHASE: phase shown when gates were last searched.
(
    ACTIVE_RIVER,
    HAND_PHASE,
    HELD,
    TIMING_RIVER,
    ENTRY_PHASE,
    LEAD,
    CLIP_PHASE,
    TRANSITION,
    GATE_PHASE,
    LAST_SEARCH_PHASE,
) = range(MEMORY, MEMORY + 10)
# Parameters: header; offsets of the packed curves, of the rest phases and of the changes; these blocks; the blend.
RIVERS, TUBE, LAPS, BLEND, CURVES = range(5)
_MAX_PACE = 2.0  # largest pace, in multiples of the river's, of a hand that no river holds: a faster one plays no clip
# [s] horizon of the prediction in `has_left_river`: without it the root's velocity jumps by up to 3.7 m/s
_PREDICTION_TIME = 0.03
# deviation from the river's pace up to which the hand is followed without lag; encoder noise is 1 %
_PACE_TOLERANCE = 0.02
_MAX_LAG = 0.25  # [s] L, largest lag of a clip behind a hand that is faster than its river
_SLOWING_LAG = 0.025  # [s] l, lag above which a clip does not slow down with the hand
_CATCH_UP_TIME = 2.0  # [s] of phase over which the clip's lead over the hand decays to zero
_PAST_FRACTION = 0.25  # of a round: a phase up to this before a moment counts as before it, all others as after it


@njit
def lap_of(params: Array, curve: int) -> float:
    """Duration of a lap of a curve [s]."""
    return float(params[curve + END] - params[curve + START])


@njit
def round_of(params: Array, curve: int) -> float:
    """Duration of a round [s]: the laps of a curve in which its clip is played."""
    return params[LAPS] * lap_of(params, curve)


@njit
def in_round(params: Array, curve: int, phase: float) -> float:
    """A phase [s] wrapped into the round."""
    start, period = params[curve + START], round_of(params, curve)
    phase -= period * np.floor((phase - start) / period)
    return min(max(phase, start), start + period)


@njit
def _nearest_lap_phase(params: Array, curve: int, phase: float, last: float) -> float:
    """Phase [s] of the round nearest to `last`, among those at the same point of the curve as `phase` in any lap."""
    if np.isnan(last):
        return phase
    lap = lap_of(params, curve)
    return in_round(params, curve, phase + lap * (np.round((last - phase) / lap) % params[LAPS]))


@njit
def phase_near(params: Array, curve: int, x: Array, last: float) -> float:
    """Phase [s] of the curve's point nearest to the stylus; of several branches, on the one that continues `last`."""
    found, lap = work_array((BRANCHES, 2)), lap_of(params, curve)
    best, nearest = np.nan, SAME_BRANCH * lap
    for k in range(branches(params, curve, x[0], x[1], x[2], params[TUBE], found)):
        distance = found[k, 0] - last
        distance = abs(distance - lap * np.round(distance / lap))
        if distance < nearest:
            best, nearest = found[k, 0], distance
    if np.isnan(best):
        best, _ = closest_phase(params, curve, x[0], x[1], x[2], last)
    return _nearest_lap_phase(params, curve, wrap_phase(params, curve, best), last)


@njit
def timing_curve(params: Array, memory: Array) -> int:
    """Offset in the parameters of the curve that gives the phase of the hand."""
    return int(params[CURVES + int(memory[TIMING_RIVER])])


@njit
def changes_of(params: Array) -> Array:
    """The precomputed changes of a map (`packed_changes`)."""
    return params[int(params[CURVES + 2 * int(params[RIVERS])]) :]


@njit
def time_after(phase: float, moment: float, period: float) -> float:
    """Time of a phase after a moment of the round [s]; negative up to a quarter of the round before it."""
    elapsed = phase - moment
    return elapsed - period * np.floor(elapsed / period + _PAST_FRACTION)


@njit
def lead_of(params: Array, memory: Array, phase: float) -> tuple[float, float]:
    """Lead [s] of the clip over a hand at a phase [s], which decays with the phase, and its derivative by the phase."""
    progress = time_after(phase, memory[ENTRY_PHASE], round_of(params, timing_curve(params, memory))) / _CATCH_UP_TIME
    return memory[LEAD] * (1.0 - smooth_step(progress)), -memory[LEAD] * smooth_step_slope(progress) / _CATCH_UP_TIME


@njit
def _absorbed_share(lead: float, faster: bool) -> float:
    """Share c of the excess of the hand's pace that the lead [s] absorbs, for a hand that is faster or slower."""
    if faster:
        return float(1.0 - smooth_step(min(abs(lead) / _MAX_LAG, 1.0)))
    return float(smooth_step(min(max(-lead / _SLOWING_LAG, 0.0), 1.0)))


@njit
def absorb_excess_pace(params: Array, memory: Array, x: Array, way: float, changed: Array) -> None:
    r"""Let the clip's lead absorb the excess of the hand's pace over the river's, so that a push rushes no clip.

    .. math:: \dot e = -c\,(r - \operatorname{sat}(r, 1 \pm 0.02)), \qquad
              c = \begin{cases} 1 - S(|e| / L) & r > 1 \\ S(-e / l) & r < 1 \end{cases}

    r is the pace of the hand, 1 for the river's; e the lead of the clip over the hand [s], negative if it lags; S the
    smooth step, L = 0.25 s and l = 0.025 s. So a clip lags behind a faster hand by at most L, and then follows at the
    hand's pace; while it lags it does not slow down with the hand, and otherwise it stops with it.

    Parameters
    ----------
    params, memory : Array
        The map's, with the hand at the phase of the memory.
    x : Array
        Position of the hand a time |way| later, or earlier if way < 0 [m], shape (3,).
    way : float
        That time [s].
    changed : Array
        A copy of the memory, or the memory itself; updated for the hand at x.
    """
    curve = timing_curve(params, memory)
    phase, period = phase_near(params, curve, x, memory[HAND_PHASE]), round_of(params, curve)
    step = phase - memory[HAND_PHASE]
    step -= period * np.round(step / period)
    off = step - min(max(step, way - _PACE_TOLERANCE * abs(way)), way + _PACE_TOLERANCE * abs(way))
    # Not if the clip is held, or the phase of the hand is not known yet.
    if memory[HELD] == 0.0 and abs(off) > 0.0:
        lead, _ = lead_of(params, memory, memory[HAND_PHASE])
        half = lead - 0.5 * _absorbed_share(lead, off * way > 0.0) * off
        changed[LEAD], changed[ENTRY_PHASE] = lead - _absorbed_share(half, off * way > 0.0) * off, phase


@njit
def is_taken_over(params: Array, memory: Array, river: float) -> bool:
    """Whether the field's active river (−1: none) takes over the hand from another river, or a held clip continues.

    The clip then begins at the phase of the hand on that river.
    """
    other = river != memory[ACTIVE_RIVER] or river != memory[TIMING_RIVER]
    return 0.0 <= river < params[RIVERS] and (other or memory[HELD] > 0.0)


@njit
def phase_rate(params: Array, memory: Array, later: Array, period: float) -> float:
    """Pace at which the hand plays the clip, 1 for the river's own, from the memory `later`, one `period` [s] on."""
    round_duration, step = round_of(params, timing_curve(params, memory)), later[HAND_PHASE] - memory[HAND_PHASE]
    return (step - round_duration * np.round(step / round_duration)) / period


@njit
def has_left_river(params: Array, memory: Array, river: float, hand: Array, rate: float) -> bool:
    """Whether the hand has left the river of the playing clip: no river is active, and it is off the tube or too fast.

    `hand` (3, 3) holds position, velocity and acceleration. So that the clip does not follow a hand that is thrown off
    the curve, the pace predicted `_PREDICTION_TIME` ahead counts too, and so does a predicted position more than half
    way to the centre of curvature, where the phase is not a useful measure of pace.
    """
    if river >= 0.0 or memory[HELD] > 0.0:
        return False
    curve = timing_curve(params, memory)
    found, x, v = work_array((BRANCHES, 2)), work_array(3), work_array(3)
    outside = branches(params, curve, hand[0, 0], hand[0, 1], hand[0, 2], params[TUBE], found) == 0
    if outside or abs(rate) > _MAX_PACE:
        return True
    for i in range(3):
        x[i] = hand[0, i] + _PREDICTION_TIME * hand[1, i] + 0.5 * _PREDICTION_TIME**2 * hand[2, i]
        v[i] = hand[1, i] + _PREDICTION_TIME * hand[2, i]
    phase = phase_near(params, curve, x, memory[HAND_PHASE])
    point, tangent = curve_point(params, curve, phase), curve_velocity(params, curve, phase)
    bend, gain, slope, square = curve_acceleration(params, curve, phase), 0.0, 0.0, 0.0
    for i in range(3):
        gain += v[i] * tangent[i]
        slope += tangent[i] ** 2 + (point[i] - x[i]) * bend[i]
        square += tangent[i] ** 2
    return slope < 0.5 * square or abs(gain) > _MAX_PACE * slope


@njit
def change_clip(params: Array, memory: Array, river: float, phase: float) -> None:
    """Play the clip of another river, from a phase [s] on of the lap that the hand is in, in the frame of the lap."""
    phase = _nearest_lap_phase(params, int(params[CURVES + int(river)]), phase, memory[HAND_PHASE])
    memory[ACTIVE_RIVER], memory[HAND_PHASE], memory[HELD], memory[LAST_ANGLE] = river, phase, 0.0, np.nan
    memory[TIMING_RIVER], memory[LEAD], memory[CLIP_PHASE], memory[TRANSITION] = river, 0.0, phase, -1.0


@njit
def has_transition(params: Array, memory: Array, river: float) -> bool:
    """Whether a precomputed change leads from the playing clip to that of a river, or the river is already playing."""
    if memory[HELD] > 0.0:
        return False
    return river == memory[ACTIVE_RIVER] or known_between(changes_of(params), memory[ACTIVE_RIVER], river)


@njit
def gate_passed(params: Array, memory: Array, river: float) -> tuple[int, float]:
    """Number and gate [s] of a change to a river whose gate was passed since the last call; number −1 if none was."""
    curve, before = timing_curve(params, memory), memory[LAST_SEARCH_PHASE]
    memory[LAST_SEARCH_PHASE] = memory[CLIP_PHASE]
    start, period = params[curve + START], round_of(params, curve)
    return passed_gate(
        changes_of(params), memory[ACTIVE_RIVER], river, before - start, memory[CLIP_PHASE] - start, period
    )


@njit
def changing(memory: Array) -> bool:
    """Whether a precomputed change is in progress."""
    return bool(memory[TRANSITION] >= 0.0)


@njit
def follow_other_curve(params: Array, memory: Array, river: float, x: Array, shown: float) -> None:
    """Take the phase of the hand at x from another river's curve, while the playing clip shows phase `shown` [s]."""
    memory[TIMING_RIVER] = river
    curve = timing_curve(params, memory)
    phase = phase_near(params, curve, x, shown)
    period, lead = round_of(params, curve), shown - phase
    memory[HAND_PHASE], memory[ENTRY_PHASE], memory[LEAD] = phase, phase, lead - period * np.round(lead / period)


@njit
def hold_at_gate(params: Array, memory: Array, gate: float) -> None:
    """Hold the playing clip at a gate [s]."""
    memory[HAND_PHASE] = params[timing_curve(params, memory) + START] + gate
    memory[HELD], memory[LEAD] = 1.0, 0.0


@njit
def begin_change(memory: Array, river: float, change: int, gate: float) -> None:
    """Play the clip of another river through a precomputed change, from its gate [s] on."""
    memory[ACTIVE_RIVER], memory[LAST_ANGLE], memory[TRANSITION], memory[GATE_PHASE] = river, np.nan, change, gate


@njit
def resume_clip(memory: Array, phase: float, ahead: float) -> None:
    """Let a held clip continue with the hand at a phase [s], ahead of the hand by a time [s]."""
    memory[HAND_PHASE], memory[LEAD], memory[HELD] = phase, ahead, 0.0


@njit
def stop_clip(params: Array, memory: Array, way: float) -> None:
    """Hold the playing clip at the rest phase nearest to `way` [s] after the shown phase; without any, just there."""
    river, rivers, curve = int(memory[ACTIVE_RIVER]), int(params[RIVERS]), timing_curve(params, memory)
    period = round_of(params, curve)
    first, last = int(params[CURVES + rivers + river]), int(params[CURVES + rivers + river + 1])
    wanted = in_round(params, curve, memory[CLIP_PHASE] + way)
    best, nearest = wanted, math.inf
    for k in range(first, last):
        distance = abs(params[k] - wanted)
        distance = min(distance, period - distance)
        if distance < nearest:
            best, nearest = params[k], distance
    memory[HAND_PHASE], memory[HELD], memory[LAST_ANGLE] = best, 1.0, np.nan
    memory[LEAD], memory[TRANSITION] = 0.0, -1.0


@njit
def advance_clip(params: Array, memory: Array, seconds: float) -> None:
    """Advance the playing clip by `seconds` at its river's own pace and hold it there; a held clip stays."""
    if memory[HELD] == 0.0:
        memory[HAND_PHASE], memory[HELD] = (
            in_round(params, timing_curve(params, memory), memory[HAND_PHASE] + seconds),
            1.0,
        )


@njit
def heading_between(pose: Pose, other: Pose) -> float:
    """Change of heading [rad] from one pose's root to another's: the twist of q' q⁻¹ about the vertical."""
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
