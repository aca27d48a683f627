"""From the stylus to what the figure should do: pose, velocity and acceleration of h along the hand's motion.

Where rivers play clips of their own, a change of river is a change of motion: the figure goes on from where it is.
"""

import math
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from numba import njit, typeof, types

from controllers.fields.instructions import TRACE_PHASE, TRACE_RIVER, VECTOR
from controllers.haptic_map.base import CompiledMap
from controllers.haptic_map.evaluate import evaluate_map
from controllers.haptic_map.expressive import base_of
from controllers.haptic_map.river_clips import (
    COURSE,
    RIVER_CLIPS,
    changing,
    gate_passed,
    knows_change,
    lets_go,
    phase_rate,
    takes_over,
)
from controllers.kernel_call import call_as_given, lend, lent
from controllers.legs.limbs import LIMB
from controllers.state import Array
from sim.compilation.compiled import entry_point
from sim.compilation.kernel_units import map_units
from sim.compilation.native import mj_differentiate_pos
from sim.compilation.units import Unit
from sim.errors import SimError
from sim.reference.reference_state import CompiledReference, carry, follow_trail, look_around
from sim.reference.river_changes import change_river, go_along, go_through, may_change, stop
from sim.reference.settling import approach, let_down, slowness
from sim.reference.stylus_filter import smooth_hand, smooth_turn, turn_rate
from sim.reference.transition import dwells, make_transition

IntArray = npt.NDArray[np.int64]


_MATRIX = types.Array(types.float64, 2, "C")
_ROUNDS = 8  # in which what comes before a motion is found: each gains three digits at the least


@njit(forceinline=True)
def _settle(reference: CompiledReference) -> None:
    """Let the three poses down to the floor, by the share of a hand that is slow."""
    s, period, transition = reference.settled, reference.period, reference.transition
    for way, pose in ((0.0, reference.pose), (-1.0, reference.before), (1.0, reference.after)):
        share = s[0] + way * period * s[1] + 0.5 * (way * period) ** 2 * s[2]
        let_down(transition.limbs, transition.ends, share, pose)


@njit
def update_reference(place: Any) -> None:
    r"""Advance the reference by one period.

    With p(s) = p + s ṗ + ½ s² p̈ and R(s) = R exp(s ω + ½ s² α) the smoothed motion x of the stylus, velocity and
    acceleration of h∘x are central differences on the figure's configuration manifold over ±T:
    v = ½ ((q₊ ⊖ q) − (q₋ ⊖ q)) / T and a = ((q₊ ⊖ q) + (q₋ ⊖ q)) / T².

    Parameters
    ----------
    place
        Where is lent (`controllers.kernel_call.lend`): the reference, updated (the stylus's motion, memory, pose (75),
        velocity (57), acceleration (57)); the stylus's measured position in H and orientation wxyz, shape (7,); and the
        trace of the field (see `controllers.fields.instructions`), which river has the hand, and where on it that is.
    """
    reference, stylus, trace = lent(place)
    _advance(reference, stylus, trace)


@njit(forceinline=True)
def _advance(reference: CompiledReference, stylus: Array, trace: Array) -> None:
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
    follow_trail(reference)
    kind, params = base_of(reference.kind, reference.params)
    # Rivers that share a hand by weights may have it in turns, many times a second: each change is gone through with.
    plays, river = kind == RIVER_CLIPS, trace[TRACE_RIVER]
    settled = reference.transition.since[0] >= reference.transition.lasts[0]
    taken = plays and takes_over(params, reference.memory, river)
    over = dwells(reference.transition, river if taken else -1.0, period)
    change, gate = gate_passed(params, reference.memory, river) if plays else (-1, 0.0)
    if over and settled and knows_change(params, reference.memory, river):
        if river != reference.memory[COURSE]:
            go_along(reference, params, river)
        elif change >= 0 and not changing(reference.memory):
            go_through(reference, params, change, river, gate)
    elif over and settled and may_change(reference, params, river, trace[TRACE_PHASE]):
        change_river(reference, params, river, trace[TRACE_PHASE])
    elif plays:
        rate = phase_rate(params, reference.memory, reference.scratch_memory, period)
        if lets_go(params, reference.memory, trace[TRACE_RIVER], reference.going, rate):
            stop(reference, params)
    look_around(reference, hand)
    carry(reference)
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


def poses_unit() -> Unit:
    """The unit of `poses_along`, but for the map's kernels."""
    return Unit.of(_poses_along, types.Array(types.int64, 1, "C"), types.int64, VECTOR, VECTOR, _MATRIX, _MATRIX)


def update_unit(reference: CompiledReference) -> Unit:
    """The unit of `update_reference`, which is called by its address."""
    return Unit.of(update_reference, types.CPointer(types.Tuple((typeof(reference), VECTOR, VECTOR))))


@entry_point
def _reference_along(update: int, reference: CompiledReference, points: Array, traces: Array, poses: Array) -> None:
    for i in range(points.shape[0]):
        call_as_given(update, (lend((reference, points[i], traces[i])),))
        poses[i] = reference.pose


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
    # Rows of what is not contiguous are of another type, and nothing checks that.
    points, traces = np.ascontiguousarray(points), np.ascontiguousarray(traces)
    _reference_along(update_unit(reference).address(), reference, points, traces, poses)


def along_unit(reference: CompiledReference) -> Unit:
    """The unit of `reference_along`, but for what that calls."""
    return Unit.of(_reference_along, types.int64, typeof(reference), _MATRIX, _MATRIX, _MATRIX)


def begin_in_motion(reference: CompiledReference, motion: Array) -> None:
    """Let a reference begin with the stylus in motion: position, velocity and acceleration in H, shape (3, 3).

    They are those of the first update, so the filter begins a period before, from where it predicts them.
    """
    p, v, a = motion
    period = reference.period
    reference.started[0] = 1.0
    reference.trail[0] = p - 2.0 * period * v + 2.0 * period**2 * a
    reference.hand[:] = motion
    for _ in range(_ROUNDS):
        before = reference.hand
        jerk = -(turn_rate.py_func(before[1], before[2]) ** 2) * before[1]
        acceleration = a - period * jerk
        velocity = v - period * acceleration - 0.5 * period**2 * jerk
        point = p - period * velocity - 0.5 * period**2 * acceleration - period**3 * jerk / 6.0
        reference.hand[:] = point, velocity, acceleration


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
    reference = unlinked_reference(figure_model, compiled, period, bandwidth, blend, limbs, clip_seconds)
    return reference._replace(units=map_units([(compiled.kind, compiled.params)]))


def unlinked_reference(
    figure_model: mujoco.MjModel,
    compiled: CompiledMap,
    period: float,
    bandwidth: float,
    blend: float = 0.0,
    limbs: Array | None = None,
    clip_seconds: float = 0.0,
) -> CompiledReference:
    """`make_reference` without the addresses of the map's kernels: nothing is compiled for it."""
    check_reference(period, bandwidth, blend)
    kind, params, memory = compiled
    legs = np.zeros((0, LIMB)) if limbs is None else limbs
    nq, nv = figure_model.nq, figure_model.nv
    return CompiledReference(
        figure_model=figure_model._address, smoothing=math.exp(-2.0 * math.pi * bandwidth * period), period=period,
        units=np.zeros(0, dtype=np.int64), kind=kind, params=params, memory=memory, hand=np.zeros((3, 3)),
        trail=np.zeros((2, 3)), going=np.zeros((3, 3)),
        orientation=np.array([1.0, 0.0, 0.0, 0.0]), turning=np.zeros((2, 3)), started=np.zeros(1), pose=np.zeros(nq),
        velocity=np.zeros(nv), acceleration=np.zeros(nv), transition=make_transition(nq, nv, blend, legs),
        clip_seconds=clip_seconds, settled=np.zeros(3), scratch_memory=memory.copy(), scratch_x=np.zeros(7),
        before=np.zeros(nq), after=np.zeros(nq), to_before=np.zeros(nv), to_after=np.zeros(nv),
    )  # fmt: skip


NO_MAP = -1
"""Kind of the map of a reference that has none."""


def no_reference(compiled: CompiledMap | None = None) -> CompiledReference:
    """What a servo without a figure has for a reference, empty; `compiled` is a map that its field is told of."""
    kind, params, memory = compiled or CompiledMap(NO_MAP, np.zeros(0), np.zeros(0))
    return CompiledReference(
        figure_model=0, smoothing=0.0, period=1.0, units=np.zeros(0, dtype=np.int64), kind=kind, params=params,
        memory=memory, hand=np.zeros((3, 3)), trail=np.zeros((2, 3)), going=np.zeros((3, 3)),
        orientation=np.array([1.0, 0.0, 0.0, 0.0]), turning=np.zeros((2, 3)), started=np.zeros(1), pose=np.zeros(0),
        velocity=np.zeros(0), acceleration=np.zeros(0), transition=make_transition(0, 0, 0.0, np.zeros((0, LIMB))),
        clip_seconds=0.0, settled=np.zeros(3), scratch_memory=memory.copy(), scratch_x=np.zeros(7),
        before=np.zeros(0), after=np.zeros(0), to_before=np.zeros(0), to_after=np.zeros(0),
    )  # fmt: skip
