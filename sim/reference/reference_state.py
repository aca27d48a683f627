"""State of the figure's reference, and the poses of its map along the motion of the stylus."""

from typing import NamedTuple

from numba import njit

from controllers.haptic_map.map_stages import evaluate_map
from controllers.haptic_map.river_memory import absorb_excess_pace
from geometry.arrays import Array, IntArray
from sim.reference.stylus_filter import extrapolate_orientation
from sim.reference.transition import Transition, apply_transition_to_pose


class CompiledReference(NamedTuple):
    """State and scratch of the reference, as the servo loop holds it.

    Attributes
    ----------
    figure_model : int
        Address of the model of the figure alone; velocity and acceleration are in its tangent space (qvel).
    smoothing : float
        θ = exp(−ω T) of the tracking filter, for its period T.
    period : float
        T [s].
    stages, params, memory, size
        The haptic map and its state, such as the frame of the lap (`controllers.haptic_map.map_stages.CompiledMap`).
    hand : Array
        Smoothed position, velocity and acceleration of the hand in H, shape (3, 3).
    trail : Array
        Smoothed position one period ago, and two, shape (2, 3).
    trail_motion : Array
        Scratch: the smoothed position with velocity and acceleration by backward differences, shape (3, 3).
    orientation, turning : Array
        Smoothed orientation R_H of the stylus (wxyz), shape (4,), and ω and α in the stylus's frame, shape (2, 3).
    started : Array
        0 before the first update, shape (1,).
    pose, velocity, acceleration : Array
        The reference that the figure is to track, shapes (75,), (57,), (57,).
    transition : Transition
        Transition from clip to clip, where each river plays its own clip.
    clip_seconds : float
        Duration of the clips [s] if a figure that is held in flight is lowered to the floor
        (`sim.reference.floor_lowering`); 0 if not.
    settled : Array
        Share s of that lowering, with its first and second derivative, shape (3,).
    cross_track : Array
        Parameters of the filter across rivers (`sim.reference.cross_track`); empty for none.
    crossing : Array
        Its state, shape (8,).
    scratch_memory, scratch_x : Array
        Scratch: a copy of `memory`, and the stylus pose (7,) at which the map is evaluated.
    before, after, to_before, to_after : Array
        Scratch: poses one period before and after (75,), and the tangents to them from `pose` (57,).
    """

    figure_model: int
    smoothing: float
    period: float
    stages: IntArray
    params: Array
    memory: Array
    size: float
    hand: Array
    trail: Array
    trail_motion: Array
    orientation: Array
    turning: Array
    started: Array
    pose: Array
    velocity: Array
    acceleration: Array
    transition: Transition
    clip_seconds: float
    settled: Array
    cross_track: Array
    crossing: Array
    scratch_memory: Array
    scratch_x: Array
    before: Array
    after: Array
    to_before: Array
    to_after: Array


@njit
def evaluate_around(reference: CompiledReference, hand: Array) -> None:
    """Poses of the map along a motion of the stylus: now, one period before and after; `memory` is that of now."""
    _evaluate_now(reference, hand)
    for sign, pose in ((-1.0, reference.before), (1.0, reference.after)):
        _extrapolate_stylus(reference, hand, sign)
        evaluate_map(reference.stages, reference.params, reference.scratch_x, reference.scratch_memory, pose)


@njit
def evaluate_around_in_river(reference: CompiledReference, params: Array, hand: Array) -> None:
    """As `evaluate_around`, for a map whose rivers play one clip each, at an even pace (`absorb_excess_pace`)."""
    _evaluate_now(reference, hand)
    for sign, pose in ((-1.0, reference.before), (1.0, reference.after)):
        _extrapolate_stylus(reference, hand, sign)
        absorb_excess_pace(
            params, reference.memory, reference.scratch_x, sign * reference.period, reference.scratch_memory
        )
        evaluate_map(reference.stages, reference.params, reference.scratch_x, reference.scratch_memory, pose)


@njit
def _evaluate_now(reference: CompiledReference, hand: Array) -> None:
    """Pose of the map at the hand's position."""
    x = reference.scratch_x
    x[:3], x[3:] = hand[0], reference.orientation
    evaluate_map(reference.stages, reference.params, x, reference.memory, reference.pose)


@njit
def _extrapolate_stylus(reference: CompiledReference, hand: Array, sign: float) -> None:
    """Write the stylus pose one period before or after now, and a copy of the memory, to the scratch arrays."""
    period, x = reference.period, reference.scratch_x
    for i in range(3):
        x[i] = hand[0, i] + sign * period * hand[1, i] + 0.5 * period**2 * hand[2, i]
    x[3], x[4], x[5], x[6] = extrapolate_orientation(reference.orientation, reference.turning, sign * period)
    reference.scratch_memory[:] = reference.memory


@njit
def follow_trail(reference: CompiledReference) -> None:
    """Backward differences of the smoothed hand's last positions, into `trail_motion`.

    The filter's own velocity and acceleration lag behind these when the hand is thrown.
    """
    now, trail, going, period = reference.hand[0], reference.trail, reference.trail_motion, reference.period
    for i in range(3):
        going[0, i] = now[i]
        going[1, i] = 0.5 * (3.0 * now[i] - 4.0 * trail[0, i] + trail[1, i]) / period
        going[2, i] = (now[i] - 2.0 * trail[0, i] + trail[1, i]) / period**2


@njit
def apply_transition(reference: CompiledReference) -> None:
    """Apply the transition in progress to the poses now, before and after."""
    if reference.transition.since[0] >= reference.transition.duration[0]:
        return
    apply_transition_to_pose(reference.transition, 0.0, reference.pose)
    apply_transition_to_pose(reference.transition, -reference.period, reference.before)
    apply_transition_to_pose(reference.transition, reference.period, reference.after)
