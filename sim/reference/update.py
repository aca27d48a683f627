"""The update of the reference by one period, for a map whose rivers play one clip each and for any other map.

Where each river plays its own clip, a change of river is a change of motion: it begins at the pose and place in which
the figure is shown (`sim.reference.river_changes`). Only such a map needs that code, so each update has its own unit.
"""

from numba import njit

from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_RIVER
from controllers.haptic_map.map_stages import first_params
from controllers.haptic_map.river_memory import (
    TIMING_RIVER,
    absorb_excess_pace,
    changing,
    gate_passed,
    has_left_river,
    has_transition,
    is_taken_over,
    phase_rate,
)
from geometry.arrays import Array
from sim.compilation.native import mj_differentiate_pos
from sim.reference.cross_track import shift_across
from sim.reference.floor_lowering import approach, lower_to_floor, lowering_goal
from sim.reference.reference_state import (
    CompiledReference,
    apply_transition,
    evaluate_around,
    evaluate_around_in_river,
    follow_trail,
)
from sim.reference.river_changes import begin_precomputed_change, change_river, may_change, stop, switch_timing_curve
from sim.reference.stylus_filter import smooth_hand, smooth_turn
from sim.reference.transition import dwell_complete


@njit
def update_reference(reference: CompiledReference, stylus: Array, trace: Array) -> None:
    r"""Advance the reference by one period.

    With p(s) = p + s ṗ + ½ s² p̈ and R(s) = R exp(s ω + ½ s² α) the smoothed motion x of the stylus, velocity and
    acceleration of h∘x are central differences on the figure's configuration manifold over ±T:
    v = ½ ((q₊ ⊖ q) − (q₋ ⊖ q)) / T and a = ((q₊ ⊖ q) + (q₋ ⊖ q)) / T².

    Parameters
    ----------
    reference : CompiledReference
        Updated: the stylus's motion, memory, pose (75), velocity (57) and acceleration (57).
    stylus : Array
        Measured position in H and orientation wxyz, shape (7,).
    trace : Array
        Trace of the field, with the active river and the hand's phase on it (see
        `controllers.fields.algebra.instructions`).
    """
    measured = reference.scratch_x
    measured[:] = stylus
    if reference.cross_track.shape[0] > 0:
        shift_across(reference.cross_track, reference.crossing, trace, measured, reference.period)
    _filter_stylus(reference, measured)
    evaluate_around(reference, reference.hand)
    _differentiate(reference)


@njit
def update_river_reference(reference: CompiledReference, stylus: Array, trace: Array) -> None:
    """As `update_reference`, for a map whose rivers play one clip each: its motion changes with the active river."""
    _filter_stylus(reference, stylus)
    reference.transition.since[0] += reference.period
    follow_trail(reference)
    params = first_params(reference.stages, reference.params)
    absorb_excess_pace(params, reference.memory, reference.hand[0], reference.period, reference.memory)
    _change_clip_if_due(reference, params, trace)
    evaluate_around_in_river(reference, params, reference.hand)
    apply_transition(reference)
    _differentiate(reference)


@njit
def _filter_stylus(reference: CompiledReference, stylus: Array) -> None:
    """Advance the tracking filter of the stylus, which starts at its first reading."""
    hand, period = reference.hand, reference.period
    if reference.started[0] == 0.0:
        reference.started[0] = 1.0
        hand[0, :] = stylus[:3]
        reference.trail[0], reference.trail[1] = stylus[:3], stylus[:3]
        reference.orientation[:] = stylus[3:]
        reference.settled[0] = lowering_goal(hand[0], hand[1], reference.clip_seconds)
    else:
        reference.trail[1], reference.trail[0] = reference.trail[0], hand[0]
        smooth_hand(hand, stylus[:3], reference.smoothing, period)
        smooth_turn(reference.orientation, reference.turning, stylus[3:], reference.smoothing, period)
        approach(reference.settled, lowering_goal(hand[0], hand[1], reference.clip_seconds), period)


@njit
def _change_clip_if_due(reference: CompiledReference, params: Array, trace: Array) -> None:
    """Begin a change to the clip of the active river, or to rest, where one is due."""
    period, river = reference.period, trace[TRACE_RIVER]
    # Rivers with blended weights may become active in turn many times a second: a change must end before the next.
    is_complete = reference.transition.since[0] >= reference.transition.duration[0]
    has_dwelt = dwell_complete(
        reference.transition, river if is_taken_over(params, reference.memory, river) else -1.0, period
    )
    change, gate = gate_passed(params, reference.memory, river)
    if has_dwelt and is_complete and has_transition(params, reference.memory, river):
        if river != reference.memory[TIMING_RIVER]:
            switch_timing_curve(reference, params, river)
        elif change >= 0 and not changing(reference.memory):
            begin_precomputed_change(reference, params, change, river, gate)
    elif has_dwelt and is_complete and may_change(reference, params, river, trace[TRACE_PHASE]):
        change_river(reference, params, river, trace[TRACE_PHASE])
    else:
        rate = phase_rate(params, reference.memory, reference.scratch_memory, period)
        if has_left_river(params, reference.memory, river, reference.trail_motion, rate):
            stop(reference, params)


@njit
def _differentiate(reference: CompiledReference) -> None:
    """Velocity and acceleration from the poses now, one period before and one period after."""
    period = reference.period
    if reference.clip_seconds > 0.0:
        _lower_poses(reference)
    for pose, difference in ((reference.before, reference.to_before), (reference.after, reference.to_after)):
        mj_differentiate_pos(reference.figure_model, difference.ctypes, 1.0, reference.pose.ctypes, pose.ctypes)
    for i in range(reference.velocity.shape[0]):
        reference.velocity[i] = 0.5 * (reference.to_after[i] - reference.to_before[i]) / period
        reference.acceleration[i] = (reference.to_after[i] + reference.to_before[i]) / period**2


@njit
def _lower_poses(reference: CompiledReference) -> None:
    """Lower the poses now, one period before and one period after to the floor by the share s, see `floor_lowering`."""
    s, period, transition = reference.settled, reference.period, reference.transition
    for sign, pose in ((0.0, reference.pose), (-1.0, reference.before), (1.0, reference.after)):
        share = s[0] + sign * period * s[1] + 0.5 * (sign * period) ** 2 * s[2]
        lower_to_floor(transition.limbs, transition.ends, share, pose, reference.size)
