"""The reference of the figure: pose, velocity and acceleration of the haptic map h along the hand's motion."""

import math

import mujoco
import numpy as np
from numba import typeof, types

from controllers.fields.algebra.instructions import VECTOR
from controllers.haptic_map.base import STYLUS_TANGENT, HapticMap
from controllers.haptic_map.map_stages import CompiledMap, evaluate_map, evaluate_map_jacobian, kernels_of
from controllers.haptic_map.river_clips import river_clips_map
from controllers.kernel_call import call_as_given
from controllers.legs.limbs import LIMB_SIZE
from controllers.lent import Lent, by_pointer
from geometry.arrays import Array, IntArray
from sim.compilation.compiled import entry_point
from sim.compilation.kernel_units import linked_stages
from sim.compilation.units import Unit
from sim.errors import SimError
from sim.reference.cross_track import no_cross_track
from sim.reference.reference_state import CompiledReference
from sim.reference.stylus_filter import turn_rate
from sim.reference.transition import Transition, make_transition
from sim.reference.update import update_reference, update_river_reference

_MATRIX = types.Array(types.float64, 2, "C")
_ITERATION_COUNT = 8  # fixed-point iterations of `begin_in_motion`; each gains at least three digits


@entry_point
def _poses_along(stages: IntArray, params: Array, memory: Array, points: Array, poses: Array) -> None:
    for i in range(points.shape[0]):
        evaluate_map(stages, params, points[i], memory, poses[i])


def map_poses(haptic_map: HapticMap, points: Array, memory: Array | None = None) -> Array:
    """Poses (n, nq) of a map along a path of the stylus (n, 7). `memory` is updated; default: that of a new run."""
    stages, params, fresh, _ = haptic_map.compiled()
    poses = np.empty((len(points), haptic_map.nq))
    _poses_along(linked_stages(stages), params, fresh if memory is None else memory, points, poses)
    return poses


def reference_poses(reference: CompiledReference, arguments: Array) -> Array:
    """Poses (n, nq) of a reference's map along a path of its arguments (n, 7); the reference is left as it is."""
    poses = np.empty((len(arguments), len(reference.pose)))
    _poses_along(linked_stages(reference.stages), reference.params, reference.memory.copy(), arguments, poses)
    return poses


def poses_unit() -> Unit:
    """The compilation unit of `map_poses`, without the map's kernels."""
    return Unit.of(_poses_along, types.Array(types.int64, 2, "C"), VECTOR, VECTOR, _MATRIX, _MATRIX)


def update_unit(reference: CompiledReference) -> Unit:
    """The compilation unit that advances a reference by one period (`sim.reference.update`), called by its address."""
    by_river = river_clips_map in kernels_of(reference.stages)
    return Unit.of(update_river_reference if by_river else update_reference, Lent(typeof(reference)), VECTOR, VECTOR)


@entry_point
def _reference_along(update: int, reference: CompiledReference, points: Array, traces: Array, poses: Array) -> None:
    for i in range(points.shape[0]):
        call_as_given(update, (by_pointer(reference), points[i], traces[i]))
        poses[i] = reference.pose


def reference_along(reference: CompiledReference, points: Array, traces: Array, poses: Array) -> None:
    """Advance a reference along a path of the stylus, period by period.

    Parameters
    ----------
    reference : CompiledReference
        Updated.
    points, traces : Array
        Stylus poses and field traces that `sim.reference.update` takes, one row per period, shapes (n, 7) and (n, 8).
    poses : Array
        Written, shape (n, 75).
    """
    linked = reference._replace(stages=linked_stages(reference.stages))
    # The kernel is compiled for contiguous rows, and a call by address does not check the types of its arguments.
    points, traces = np.ascontiguousarray(points), np.ascontiguousarray(traces)
    _reference_along(update_unit(linked).address(), linked, points, traces, poses)


def along_unit(reference: CompiledReference) -> Unit:
    """The compilation unit of `reference_along`, without the kernels that it calls by address."""
    return Unit.of(_reference_along, types.int64, typeof(reference), _MATRIX, _MATRIX, _MATRIX)


def begin_in_motion(reference: CompiledReference, motion: Array) -> None:
    """Start a reference with the stylus in motion: position, velocity and acceleration in H, shape (3, 3).

    `motion` is the state at the first update. The filter is set to the state one period earlier from which it predicts
    `motion`; this is found by fixed-point iteration, since the predicted jerk depends on that earlier state.
    """
    p, v, a = motion
    period = reference.period
    reference.started[0] = 1.0
    reference.trail[0] = p - 2.0 * period * v + 2.0 * period**2 * a
    reference.hand[:] = motion
    for _ in range(_ITERATION_COUNT):
        before = reference.hand
        jerk = -(turn_rate.py_func(before[1], before[2]) ** 2) * before[1]
        acceleration = a - period * jerk
        velocity = v - period * acceleration - 0.5 * period**2 * jerk
        point = p - period * velocity - 0.5 * period**2 * acceleration - period**3 * jerk / 6.0
        reference.hand[:] = point, velocity, acceleration


def check_reference(period: float, bandwidth: float, blend: float) -> None:
    """Check the arguments of `make_reference`.

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
    figure_model: mujoco.MjModel, compiled: CompiledMap, period: float, bandwidth: float, blend: float = 0.0,
    limbs: Array | None = None, clip_seconds: float = 0.0, cross_track: Array | None = None,
) -> CompiledReference:  # fmt: skip
    """The reference of a run, before its first update, without the addresses of the map's kernels.

    So nothing need be compiled yet; `reference_along` and `sim.loop.servo.Servo.linked` fill the addresses in.

    Parameters
    ----------
    figure_model
        The model of the figure alone; must outlive the reference.
    compiled : CompiledMap
        The haptic map.
    period : float
        Time T between two updates [s].
    bandwidth : float
        Bandwidth ω/2π of the tracking filter [Hz].
    blend : float
        Shortest blend time of a transition from one clip to another [s]; 0: the figure jumps.
    limbs : Array, optional
        Legs that step during a transition (`packed_steppers`); without them the feet slide.
    clip_seconds : float
        Duration of the clips [s] if a figure that is held in flight is to be lowered to the floor
        (`sim.reference.floor_lowering`); 0 if not.
    cross_track : Array, optional
        How the figure follows a hand across rivers (`sim.reference.cross_track`); by default at once.

    Raises
    ------
    SimError
        As `check_reference`.
    """
    check_reference(period, bandwidth, blend)
    nq, nv = figure_model.nq, figure_model.nv
    transition = make_transition(nq, nv, blend, np.zeros((0, LIMB_SIZE)) if limbs is None else limbs)
    return _initial_reference(compiled, (nq, nv), transition)._replace(
        figure_model=figure_model._address, smoothing=math.exp(-2.0 * math.pi * bandwidth * period), period=period,
        clip_seconds=clip_seconds, cross_track=np.zeros(0) if cross_track is None else cross_track,
    )  # fmt: skip


def no_reference() -> CompiledReference:
    """The empty reference of a servo without a figure."""
    empty_map = CompiledMap(np.zeros((0, 3), dtype=np.int64), np.zeros(0), np.zeros(0))
    return _initial_reference(empty_map, (0, 0), make_transition(0, 0, 0.0, np.zeros((0, LIMB_SIZE))))


def _initial_reference(compiled: CompiledMap, sizes: tuple[int, int], transition: Transition) -> CompiledReference:
    """State of a reference before its first update, of a body with poses of nq and tangents of nv numbers."""
    (stages, params, memory, size), (nq, nv) = compiled, sizes
    return CompiledReference(
        figure_model=0, smoothing=0.0, period=1.0, stages=stages, params=params, memory=memory,
        size=size, hand=np.zeros((3, 3)), trail=np.zeros((2, 3)), trail_motion=np.zeros((3, 3)),
        orientation=np.array([1.0, 0.0, 0.0, 0.0]), turning=np.zeros((2, 3)), started=np.zeros(1), pose=np.zeros(nq),
        velocity=np.zeros(nv), acceleration=np.zeros(nv), transition=transition, clip_seconds=0.0,
        settled=np.zeros(3), cross_track=np.zeros(0), crossing=no_cross_track(), scratch_memory=memory.copy(),
        scratch_x=np.zeros(7), before=np.zeros(nq), after=np.zeros(nq), to_before=np.zeros(nv), to_after=np.zeros(nv),
    )  # fmt: skip


@entry_point
def _derivatives(stages: IntArray, params: Array, points: Array, memory: Array, pose: Array, jacobians: Array) -> None:
    for i in range(points.shape[0]):
        evaluate_map_jacobian(stages, params, points[i], memory[i], pose, jacobians[i])


def derivatives_unit() -> Unit:
    """The compilation unit of `map_derivatives`, without the map's kernels."""
    stages, jacobians = types.Array(types.int64, 2, "C"), types.Array(types.float64, 3, "C")
    return Unit.of(_derivatives, stages, VECTOR, _MATRIX, _MATRIX, VECTOR, jacobians)


def map_derivatives(haptic_map: HapticMap, points: Array) -> Array:
    """`HapticMap.jacobian` at stylus poses (n, 7), bit for bit the same, by kernels from the compilation cache.

    Returns
    -------
    Array, shape (n, nv, 6)
    """
    stages, params, memory, _ = haptic_map.compiled()
    jacobians = np.empty((len(points), haptic_map.nv, STYLUS_TANGENT))
    fresh = np.tile(memory, (len(points), 1))
    _derivatives(linked_stages(stages), params, points, fresh, np.empty(haptic_map.nq), jacobians)
    return jacobians
