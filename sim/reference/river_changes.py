"""Changes of the active river: the transition of the figure's motion to another river's clip, or to rest.

A change is made by inertialisation (`sim.reference.transition`), or by a precomputed change that begins at a gate: a
phase of the lap (`controllers.haptic_map.clip_change`).
"""

import math

import numpy as np
from numba import njit

from controllers.haptic_map.map_stages import evaluate_map
from controllers.haptic_map.river_memory import (
    CLIP_PHASE,
    HAND_PHASE,
    LEAD,
    advance_clip,
    begin_change,
    change_clip,
    follow_other_curve,
    heading_between,
    hold_at_gate,
    phase_rate,
    place_clip,
    resume_clip,
    stop_clip,
)
from controllers.legs.footsteps import limb_end
from controllers.motion.inertialization import stopping_distance
from geometry.arrays import Array
from geometry.rotations import rotate
from sim.reference.floor_lowering import clearance
from sim.reference.reference_state import CompiledReference, apply_transition, evaluate_around_in_river
from sim.reference.transition import DWELL_TIME, Transition, note_change, pivot_of, plan_depth, set_duration

_STANDING_CLEARANCE = 0.01  # [m] clearance of the feet below which the figure stands
_LEAP_CLEARANCE = 0.05  # [m] clearance of the feet above which it is in a leap
_TAKE_OFF_SPEED = 0.6  # [m/s] vertical speed of the root above which the figure takes off: enough to rise by 2 cm
_MAX_WAIT_TIME = 1.0  # [s] longest wait of a change


@njit
def is_standing(transition: Transition, pose: Array, rise: float, size: float) -> bool:
    """Whether a figure stands and is not about to take off; `rise` is the vertical speed of its root [m/s]."""
    return clearance(transition.limbs, transition.ends, pose, size) < _STANDING_CLEARANCE and rise < _TAKE_OFF_SPEED


@njit
def is_leaping(transition: Transition, pose: Array, size: float) -> bool:
    """Whether a pose is in the middle of a flight, where no new motion may begin; `size` is that of the figure."""
    return clearance(transition.limbs, transition.ends, pose, size) > _LEAP_CLEARANCE


@njit
def has_waited_enough(transition: Transition) -> bool:
    """Whether the river that would take over has waited long enough; without legs or blend time there is no wait."""
    return (
        transition.candidate_river[1] > DWELL_TIME + _MAX_WAIT_TIME
        or transition.seconds == 0.0
        or transition.limbs.shape[0] == 0
    )


@njit
def _evaluate_ahead(reference: CompiledReference, params: Array, seconds: float, pose: Array) -> None:
    """Pose of the playing clip `seconds` from now, if it goes on at its river's own pace."""
    memory = reference.scratch_memory
    memory[:] = reference.memory
    advance_clip(params, memory, seconds)
    evaluate_map(reference.stages, reference.params, reference.scratch_x, memory, pose)


@njit
def _place_clip(reference: CompiledReference, pose: Array, x: float, y: float, turn: float) -> None:
    """As `place_clip`, with lengths of the shown figure; the frame of the lap is in lengths of the clips' figure."""
    size = reference.size
    place_clip(reference.memory, pose[:2] / size, x / size, y / size, turn)


@njit
def _store_shown_poses(reference: CompiledReference, params: Array) -> None:
    """Store the poses that are shown now, one period before and one period after."""
    evaluate_around_in_river(reference, params, reference.trail_motion)
    apply_transition(reference)
    shown = reference.transition.shown
    shown[0], shown[1], shown[2] = reference.pose, reference.before, reference.after


@njit
def _place_on_pivot(reference: CompiledReference, params: Array) -> tuple[int, float]:
    """Place the new motion such that the pivot foot, in stance before and after the change, stays where it is.

    If the figure stands on that foot alone, the motion is turned to match its heading as well. Returns the foot, −1 if
    there is none, and the horizontal distance by which the motion was moved [m].
    """
    transition, old, new = reference.transition, np.empty(7), np.empty(7)
    _evaluate_ahead(reference, params, 0.5 * transition.duration[0], transition.ahead[0])
    _evaluate_ahead(reference, params, transition.duration[0], transition.ahead[1])
    foot, row = pivot_of(transition)
    moved = 0.0
    if foot >= 0:
        limb_end(transition.limbs[foot], transition.shown[0], old)
        limb_end(transition.limbs[foot], transition.ahead[row], new)
        turn = heading_between(new, old) if np.sum(transition.stance) == 1.0 else 0.0
        _place_clip(reference, new, old[0], old[1], turn)
        moved = math.hypot(new[0] - old[0], new[1] - old[1])
    return foot, moved


@njit
def _begin_transition(reference: CompiledReference, params: Array) -> None:
    """Begin the transition from the shown motion to that of the memory, with an offset that decays.

    The new motion is placed ahead of the figure by the stopping distance of the difference of their horizontal and yaw
    velocities, so that the figure is neither turned back nor pulled; or, if there is a pivot foot, where it stands.
    """
    transition, period = reference.transition, reference.period
    shown, change = transition.shown, transition.change
    evaluate_around_in_river(reference, params, reference.trail_motion)
    pose = reference.pose
    _place_clip(reference, pose, shown[0, 0], shown[0, 1], heading_between(pose, shown[0]))
    evaluate_around_in_river(reference, params, reference.trail_motion)
    note_change(transition, reference.figure_model, period, pose, reference.before, reference.after, -1)
    set_duration(transition, 0.0, period)
    stopping, seconds = np.zeros(3), transition.duration[0]
    for i in range(2):
        stopping[i] = stopping_distance(change[1, i], change[2, i], seconds)
    _, _, spin = rotate(pose[3], pose[4], pose[5], pose[6], change[1, 3], change[1, 4], change[1, 5])
    _, _, twist = rotate(pose[3], pose[4], pose[5], pose[6], change[2, 3], change[2, 4], change[2, 5])
    stopping[2] = stopping_distance(spin, twist, seconds)
    _place_clip(reference, pose, pose[0] + stopping[0], pose[1] + stopping[1], stopping[2])
    _, moved = _place_on_pivot(reference, params)
    set_duration(transition, moved, period)
    # A longer change ends at another pose: place the motion again by where the foot stands then.
    foot, _ = _place_on_pivot(reference, params)
    evaluate_around_in_river(reference, params, reference.trail_motion)
    note_change(transition, reference.figure_model, period, pose, reference.before, reference.after, foot)
    _evaluate_ahead(reference, params, 0.5 * transition.duration[0], transition.ahead[0])
    plan_depth(transition)
    transition.since[0] = 0.0


@njit
def may_change(reference: CompiledReference, params: Array, river: float, phase: float) -> bool:
    """Whether a change to another river's clip may begin now.

    The figure must stand and the new clip must not be in flight during the transition; see `is_standing`. A
    river that has waited long enough is let through regardless.
    """
    transition, memory, x = reference.transition, reference.scratch_memory, reference.scratch_x
    size = reference.size
    if has_waited_enough(transition):
        return True
    if not is_standing(transition, reference.pose, reference.velocity[2], size):
        return False
    for k in range(3):
        memory[:] = reference.memory
        change_clip(params, memory, river, phase)
        # Evaluated first to get the phase from the hand's position: the field may time the curve unlike the clip.
        evaluate_map(reference.stages, reference.params, x, memory, transition.ahead[0])
        advance_clip(params, memory, 0.5 * k * transition.seconds)
        evaluate_map(reference.stages, reference.params, x, memory, transition.ahead[0])
        if is_leaping(transition, transition.ahead[0], size):
            return False
    return True


@njit
def change_river(reference: CompiledReference, params: Array, river: float, phase: float) -> None:
    """Change to another river's clip, at a phase [s], by a transition from what is shown."""
    _store_shown_poses(reference, params)
    change_clip(params, reference.memory, river, phase)
    _begin_transition(reference, params)


@njit
def switch_timing_curve(reference: CompiledReference, params: Array, river: float) -> None:
    """Take the hand's phase from another river's curve, while the clip goes on to the gate of a precomputed change."""
    scratch, x = reference.scratch_memory, reference.scratch_x
    x[:3], x[3:] = reference.hand[0], reference.orientation
    scratch[:] = reference.memory
    evaluate_map(reference.stages, reference.params, x, scratch, reference.before)
    follow_other_curve(params, reference.memory, river, x, scratch[CLIP_PHASE])


@njit
def begin_precomputed_change(
    reference: CompiledReference, params: Array, change: int, river: float, gate: float
) -> None:
    """Begin a precomputed change to another river's clip at a gate [s] just passed, where the old clip was then."""
    memory, scratch, x = reference.memory, reference.scratch_memory, reference.scratch_x
    old, new, phase, ahead = reference.before, reference.after, memory[HAND_PHASE], memory[LEAD]
    scratch[:] = memory
    hold_at_gate(params, scratch, gate)
    evaluate_map(reference.stages, reference.params, x, scratch, old)
    begin_change(memory, river, change, gate)
    hold_at_gate(params, memory, gate)
    evaluate_map(reference.stages, reference.params, x, memory, new)
    _place_clip(reference, new, old[0], old[1], heading_between(new, old))
    resume_clip(memory, phase, ahead)


@njit
def stop(reference: CompiledReference, params: Array) -> None:
    """Bring the playing clip to rest, at the rest phase nearest to where it would come to a stop."""
    memory, period = reference.memory, reference.period
    _store_shown_poses(reference, params)
    # Clamped to the clip's own pace: a hand thrown along the curve, or against it, would overshoot.
    pace = min(max(phase_rate(params, memory, reference.scratch_memory, period), -1.0), 1.0)
    stop_clip(params, memory, stopping_distance(pace, 0.0, reference.transition.seconds))
    _begin_transition(reference, params)
