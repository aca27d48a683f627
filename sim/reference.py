"""From the stylus to what the figure should do: pose, velocity and acceleration of h along the hand's motion.

Where rivers play clips of their own, a change of river is a change of motion: the figure goes on from where it is.
"""

import math
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.fields.instructions import TRACE_PHASE, TRACE_RIVER
from controllers.haptic_map.base import CompiledMap
from controllers.haptic_map.evaluate import evaluate_map
from controllers.haptic_map.expressive import base_of
from controllers.haptic_map.footsteps import limb_end
from controllers.haptic_map.inertialization import stopping_way
from controllers.haptic_map.limbs import LIMB
from controllers.haptic_map.river_clips import (
    RIVER_CLIPS,
    ahead_in_clip,
    change_clip,
    heading_between,
    lets_go,
    phase_rate,
    place_clip,
    stop_clip,
    takes_over,
)
from controllers.rotations import rotate
from sim.compiled import entry_point
from sim.errors import SimError
from sim.kernel_units import map_units
from sim.native import mj_differentiate_pos
from sim.settling import approach, let_down, slowness
from sim.stylus_filter import smooth_hand, smooth_turn, turned_on
from sim.transition import (
    Transition,
    carry_on,
    dwells,
    make_transition,
    note_change,
    pivot_of,
    plan_depth,
    set_duration,
)
from sim.waiting import leaps, stands, waits_no_longer

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class CompiledReference(NamedTuple):
    """State and scratch of the reference, as the servo loop holds it.

    Attributes
    ----------
    figure_model : int
        Address of the model of the figure alone, whose tangent space the reference lives in.
    smoothing : float
        θ = exp(−ω T) of the tracking filter, for the period T at which it runs.
    period : float
        T [s].
    units : IntArray
        Addresses of the map's kernels (see `sim.kernel_units`).
    kind, params, memory
        The haptic map and its state (the lap).
    hand : Array
        Smoothed position, velocity and acceleration of the hand in H, shape (3, 3).
    trail : Array
        Smoothed position one period ago, and two, shape (2, 3).
    going : Array
        Scratch: the hand with the rates at which its smoothed position goes, shape (3, 3).
    orientation, turning : Array
        Smoothed orientation R_H of the stylus (wxyz), shape (4,), and in its own frame ω and α, shape (2, 3).
    started : Array
        0 until the hand has been seen, shape (1,).
    pose, velocity, acceleration : Array
        What the figure should do, shapes (75,), (57,), (57,).
    transition : Transition
        From clip to clip, where rivers play clips of their own.
    clip_seconds : float
        Time of the clips [s] where flights that are held are let down to the floor (`sim.settling`); 0: they are not.
    settled : Array
        Share by which they are, and its rates, shape (3,).
    """

    figure_model: int
    smoothing: float
    period: float
    units: IntArray
    kind: int
    params: Array
    memory: Array
    hand: Array
    trail: Array
    going: Array
    orientation: Array
    turning: Array
    started: Array
    pose: Array
    velocity: Array
    acceleration: Array
    transition: Transition
    clip_seconds: float
    settled: Array
    scratch_memory: Array
    scratch_x: Array
    before: Array
    after: Array
    to_before: Array
    to_after: Array


@njit
def _look_around(reference: CompiledReference, hand: Array) -> None:
    """Poses of the map along a motion of the stylus: now, a period before and a period after; the memory is now's."""
    period, x = reference.period, reference.scratch_x
    x[:3], x[3:] = hand[0], reference.orientation
    evaluate_map(reference.units, reference.kind, reference.params, x, reference.memory, reference.pose)
    for sign, pose in ((-1.0, reference.before), (1.0, reference.after)):
        for i in range(3):
            x[i] = hand[0, i] + sign * period * hand[1, i] + 0.5 * period**2 * hand[2, i]
        x[3], x[4], x[5], x[6] = turned_on(reference.orientation, reference.turning, sign * period)
        reference.scratch_memory[:] = reference.memory
        evaluate_map(reference.units, reference.kind, reference.params, x, reference.scratch_memory, pose)


@njit
def _follow_trail(reference: CompiledReference) -> None:
    """Rates of the smoothed hand by its own last positions: the filter's come after, where a hand is thrown."""
    now, trail, going, period = reference.hand[0], reference.trail, reference.going, reference.period
    for i in range(3):
        going[0, i] = now[i]
        going[1, i] = 0.5 * (3.0 * now[i] - 4.0 * trail[0, i] + trail[1, i]) / period
        going[2, i] = (now[i] - 2.0 * trail[0, i] + trail[1, i]) / period**2


@njit
def _carry(reference: CompiledReference) -> None:
    """Move the three poses to what a transition shows."""
    carry_on(reference.transition, 0.0, reference.pose)
    carry_on(reference.transition, -reference.period, reference.before)
    carry_on(reference.transition, reference.period, reference.after)


@njit
def _settle(reference: CompiledReference) -> None:
    """Let the three poses down to the floor, by the share of a hand that is slow."""
    s, period, transition = reference.settled, reference.period, reference.transition
    for way, pose in ((0.0, reference.pose), (-1.0, reference.before), (1.0, reference.after)):
        share = s[0] + way * period * s[1] + 0.5 * (way * period) ** 2 * s[2]
        let_down(transition.limbs, transition.ends, share, pose)


@njit
def _look_ahead(reference: CompiledReference, params: Array, seconds: float, pose: Array) -> None:
    """Pose of the clip that plays, some time from now, if it goes on at the pace of its river."""
    memory = reference.scratch_memory
    memory[:] = reference.memory
    ahead_in_clip(params, memory, seconds)
    evaluate_map(reference.units, reference.kind, reference.params, reference.scratch_x, memory, pose)


@njit
def _show_on(reference: CompiledReference) -> None:
    """Note what is shown: now, a period before and a period after."""
    _look_around(reference, reference.going)
    _carry(reference)
    shown = reference.transition.shown
    shown[0], shown[1], shown[2] = reference.pose, reference.before, reference.after


@njit
def _stand_on_pivot(reference: CompiledReference, params: Array) -> tuple[int, float]:
    """Place the motion where it has the foot that stands before and after; which it is, −1 for none, and how far [m].

    A figure that stands on it alone turns with it.
    """
    transition, old, new = reference.transition, np.empty(7), np.empty(7)
    _look_ahead(reference, params, 0.5 * transition.lasts[0], transition.ahead[0])
    _look_ahead(reference, params, transition.lasts[0], transition.ahead[1])
    foot, row = pivot_of(transition)
    moved = 0.0
    if foot >= 0:
        limb_end(transition.limbs[foot], transition.shown[0], old)
        limb_end(transition.limbs[foot], transition.ahead[row], new)
        turn = heading_between(new, old) if np.sum(transition.stands) == 1.0 else 0.0
        place_clip(reference.memory, new, old[0], old[1], turn)
        moved = math.hypot(new[0] - old[0], new[1] - old[1])
    return foot, moved


@njit
def _go_over(reference: CompiledReference, params: Array) -> None:
    """Let the motion that the memory now has go on from what was shown, with an offset that decays.

    It begins ahead of the figure by the way on which its speed over the ground, and about the vertical, comes to
    that of the new motion, so it neither turns back nor is pulled there; or where a foot of it stands already.
    """
    transition, memory, period = reference.transition, reference.memory, reference.period
    shown, change = transition.shown, transition.change
    _look_around(reference, reference.going)
    pose = reference.pose
    place_clip(memory, pose, shown[0, 0], shown[0, 1], heading_between(pose, shown[0]))
    _look_around(reference, reference.going)
    note_change(transition, reference.figure_model, period, pose, reference.before, reference.after, -1)
    set_duration(transition, 0.0, period)
    way, seconds = np.zeros(3), transition.lasts[0]
    for i in range(2):
        way[i] = stopping_way(change[1, i], change[2, i], seconds)
    _, _, spin = rotate(pose[3], pose[4], pose[5], pose[6], change[1, 3], change[1, 4], change[1, 5])
    _, _, twist = rotate(pose[3], pose[4], pose[5], pose[6], change[2, 3], change[2, 4], change[2, 5])
    way[2] = stopping_way(spin, twist, seconds)
    place_clip(memory, pose, pose[0] + way[0], pose[1] + way[1], way[2])
    _, moved = _stand_on_pivot(reference, params)
    set_duration(transition, moved, period)
    # Where the motion stands when a longer change ends.
    foot, _ = _stand_on_pivot(reference, params)
    _look_around(reference, reference.going)
    note_change(transition, reference.figure_model, period, pose, reference.before, reference.after, foot)
    _look_ahead(reference, params, 0.5 * transition.lasts[0], transition.ahead[0])
    plan_depth(transition)
    transition.since[0] = 0.0


@njit
def _may_change(reference: CompiledReference, params: Array, river: float, phase: float) -> bool:
    """Whether the figure stands, and another river's clip does not leap before it is shown; or has waited for that."""
    transition, memory = reference.transition, reference.scratch_memory
    if waits_no_longer(transition):
        return True
    if not stands(transition, reference.pose, reference.velocity[2]):
        return False
    for k in range(3):
        memory[:] = reference.memory
        change_clip(memory, river, phase)
        ahead_in_clip(params, memory, 0.5 * k * transition.seconds)
        evaluate_map(reference.units, reference.kind, params, reference.scratch_x, memory, transition.ahead[0])
        if leaps(transition, transition.ahead[0]):
            return False
    return True


@njit
def _change_river(reference: CompiledReference, params: Array, river: float, phase: float) -> None:
    """Let another river's clip go on from what is shown."""
    _show_on(reference)
    change_clip(reference.memory, river, phase)
    _go_over(reference, params)


@njit
def _stop(reference: CompiledReference, params: Array) -> None:
    """Let the clip that plays come to rest: at the phase of rest nearest to where it would."""
    memory, period = reference.memory, reference.period
    _show_on(reference)
    # Of the clip's own pace, not of a hand that is thrown along the curve or against it.
    pace = min(max(phase_rate(params, memory, reference.scratch_memory, period), -1.0), 1.0)
    stop_clip(params, memory, stopping_way(pace, 0.0, reference.transition.seconds))
    _go_over(reference, params)


@njit
def update_reference(reference: CompiledReference, stylus: Array, trace: Array) -> None:
    r"""Advance the reference by one period.

    With p(s) = p + s ṗ + ½ s² p̈ and R(s) = R exp(s ω + ½ s² α) the smoothed motion x of the stylus, velocity and
    acceleration of h∘x are central differences on the figure's configuration manifold over ±T:
    v = ½ ((q₊ ⊖ q) − (q₋ ⊖ q)) / T and a = ((q₊ ⊖ q) + (q₋ ⊖ q)) / T².

    Parameters
    ----------
    reference : CompiledReference
        Updated: the stylus's motion, memory, pose (75), velocity (57), acceleration (57).
    stylus : Array
        Measured position in H and orientation wxyz, shape (7,).
    trace : Array
        Of the field (see `controllers.fields.instructions`): which river has the hand, and where on it the hand is.
    """
    hand, period = reference.hand, reference.period
    if reference.started[0] == 0.0:
        reference.started[0] = 1.0
        hand[0, :] = stylus[:3]
        reference.trail[0], reference.trail[1] = stylus[:3], stylus[:3]
        reference.orientation[:] = stylus[3:]
        reference.settled[0] = slowness(hand[0], hand[1], reference.clip_seconds)
    else:
        reference.trail[1], reference.trail[0] = reference.trail[0], hand[0]
        smooth_hand(hand, stylus[:3], reference.smoothing, period)
        smooth_turn(reference.orientation, reference.turning, stylus[3:], reference.smoothing, period)
        approach(reference.settled, slowness(hand[0], hand[1], reference.clip_seconds), period)
    reference.transition.since[0] += period
    _follow_trail(reference)
    kind, params = base_of(reference.kind, reference.params)
    # Rivers that share a hand by weights may have it in turns, many times a second: each change is gone through with.
    settled = reference.transition.since[0] >= reference.transition.lasts[0]
    taken = kind == RIVER_CLIPS and takes_over(params, reference.memory, trace[TRACE_RIVER])
    over = dwells(reference.transition, trace[TRACE_RIVER] if taken else -1.0, period) and settled
    if over and _may_change(reference, params, trace[TRACE_RIVER], trace[TRACE_PHASE]):
        _change_river(reference, params, trace[TRACE_RIVER], trace[TRACE_PHASE])
    elif kind == RIVER_CLIPS:
        rate = phase_rate(params, reference.memory, reference.scratch_memory, period)
        if lets_go(params, reference.memory, trace[TRACE_RIVER], reference.going, rate):
            _stop(reference, params)
    _look_around(reference, hand)
    _carry(reference)
    if reference.clip_seconds > 0.0:
        _settle(reference)
    for pose, difference in ((reference.before, reference.to_before), (reference.after, reference.to_after)):
        mj_differentiate_pos(reference.figure_model, difference.ctypes, 1.0, reference.pose.ctypes, pose.ctypes)
    for i in range(reference.velocity.shape[0]):
        reference.velocity[i] = 0.5 * (reference.to_after[i] - reference.to_before[i]) / period
        reference.acceleration[i] = (reference.to_after[i] + reference.to_before[i]) / period**2


@entry_point
def _poses_along(units: IntArray, kind: int, params: Array, memory: Array, points: Array, poses: Array) -> None:
    for i in range(points.shape[0]):
        evaluate_map(units, kind, params, points[i], memory, poses[i])


def poses_along(kind: int, params: Array, memory: Array, points: Array, poses: Array) -> None:
    """Evaluate a map along a path of the stylus.

    Parameters
    ----------
    kind, params, memory
        The map; its memory is updated.
    points : Array
        Positions in H and orientations wxyz, shape (n, 7).
    poses : Array
        Set, shape (n, 75).
    """
    _poses_along(map_units([(kind, params)]), kind, params, memory, points, poses)


@entry_point
def reference_along(reference: CompiledReference, points: Array, traces: Array, poses: Array) -> None:
    """Let a reference go along a path of the stylus, period by period.

    Parameters
    ----------
    reference : CompiledReference
        Updated.
    points, traces : Array
        What `update_reference` takes, row by row, shapes (n, 7) and (n, 8).
    poses : Array
        Set, shape (n, 75).
    """
    for i in range(points.shape[0]):
        update_reference(reference, points[i], traces[i])
        poses[i] = reference.pose


def begin_in_motion(reference: CompiledReference, motion: Array) -> None:
    """Let a reference begin with the stylus in motion: position, velocity and acceleration in H, shape (3, 3).

    They are those of the first update, so the filter begins a period before, from where it predicts them.
    """
    p, v, a = motion
    period = reference.period
    reference.started[0] = 1.0
    reference.trail[0] = p - 2.0 * period * v + 2.0 * period**2 * a
    reference.hand[:] = p - period * v + 0.5 * period**2 * a, v - period * a, a


def check_reference(period: float, bandwidth: float, blend: float) -> None:
    """Refuse numbers that `make_reference` could not take.

    Raises
    ------
    SimError
        If the bandwidth is not positive, or too high for the period; or the blend time negative or not finite.
    """
    if not 0.0 < bandwidth < 0.5 / period:
        raise SimError(
            f"smoothing, the bandwidth of the stylus filter, is {bandwidth} Hz; expected more than 0 and less than "
            f"{0.5 / period:g} Hz"
        )
    if not 0.0 <= blend < math.inf:
        raise SimError(f"the blend time of a transition is {blend} s; expected a finite number ≥ 0")


def make_reference(
    figure_model: mujoco.MjModel,
    compiled: CompiledMap,
    period: float,
    bandwidth: float,
    blend: float = 0.0,
    limbs: Array | None = None,
    clip_seconds: float = 0.0,
) -> CompiledReference:
    """The reference of a run, before its first update.

    Parameters
    ----------
    figure_model
        The figure alone; must outlive the reference.
    compiled : CompiledMap
        The haptic map.
    period : float
        T, between two updates [s].
    bandwidth : float
        Of the tracking filter, ω/2π [Hz].
    blend : float
        In which one clip goes over into another [s]; 0: the figure jumps.
    limbs : Array, optional
        Legs that step meanwhile, `packed_steppers`; without them the feet slide.
    clip_seconds : float
        Time of the clips [s], where flights that are held are to be let down to the floor.

    Raises
    ------
    SimError
        As `check_reference`.
    """
    check_reference(period, bandwidth, blend)
    kind, params, memory = compiled
    legs = np.zeros((0, LIMB)) if limbs is None else limbs
    nq, nv = figure_model.nq, figure_model.nv
    return CompiledReference(
        figure_model=figure_model._address, smoothing=math.exp(-2.0 * math.pi * bandwidth * period), period=period,
        units=map_units([(kind, params)]), kind=kind, params=params, memory=memory, hand=np.zeros((3, 3)),
        trail=np.zeros((2, 3)), going=np.zeros((3, 3)),
        orientation=np.array([1.0, 0.0, 0.0, 0.0]), turning=np.zeros((2, 3)), started=np.zeros(1), pose=np.zeros(nq),
        velocity=np.zeros(nv), acceleration=np.zeros(nv), transition=make_transition(nq, nv, blend, legs),
        clip_seconds=clip_seconds, settled=np.zeros(3), scratch_memory=memory.copy(), scratch_x=np.zeros(7),
        before=np.zeros(nq), after=np.zeros(nq), to_before=np.zeros(nv), to_after=np.zeros(nv),
    )  # fmt: skip
