"""Dynamically feasible transitions between the clips of different rivers, computed before a run.

A transition by decaying offsets and quick steps (`sim.reference.river_changes`) needs a residual force of 13 to 25 % of
body weight, and the figure may fall. It serves as the initial guess only: such transitions are generated at several
moments of the stride and ranked by residual. The best are made feasible from 0.7 s before the change to 0.9 s after it,
like a capture (`models.mocap.preparation.feasible`); both ends stay equal to the clips.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.haptic_map.clip_change import FPS, LEAD_IN, ClipChange
from controllers.haptic_map.river_clips import MAX_CHANGE_FRACTION, RiverClips
from controllers.haptic_map.river_memory import ACTIVE_RIVER, HAND_PHASE
from controllers.state import stylus_path
from experiments.console.progress import working
from experiments.files.array_cache import cached_array, is_cached
from experiments.fitting.figure_legs import packed_legs
from geometry import quaternions
from geometry.arrays import Array
from geometry.easing import smooth_step
from models.humanoid.skeleton import N_TANGENT
from models.mocap.motion.clip import Clip
from models.mocap.preparation.contact_loads import contact_forces
from models.mocap.preparation.feasible import Feasible, feasible
from models.mocap.preparation.stances import Stances, stances
from sim.compilation.workers import run_in_workers
from sim.reference.reference import make_reference, map_poses, reference_along

_TIME_BEFORE, _TIME_AFTER = 0.7, 0.9  # [s] optimised time before and after a change
_SETTLING, _BANDWIDTH = 1.0, 40.0  # [s] settling time and [Hz] cut-off of the stylus filter, too high to show
_BLOCK = 6  # frames between two checks of whether the clip has changed
_ITERATIONS = 10
_CONTEXT = 0.5  # [s] context on either side of a change, for the detection of its stances
_N_MOMENTS = 8  # moments of a stride at which a change by offsets is tried
# Maximum number of them that are made feasible, and the cost below which no more are tried. With 12 iterations, three
# tries and waits of 2.4 s, which take longer, the figure stayed up on eight of eight sets of captures; with these
# numbers it does on seven or eight.
_MAX_TRIES, _GOOD_COST = 2, 400.0
_TARGET_WAIT_TIME = 2.0  # [s] time between gates: about the longest that a hand waits for one
_MAX_GATES = 3  # in a stride, since each takes some seconds to compute; a long stride has more
_MAX_WAIT_TIME = 4.0  # [s] between gates in long strides, which have as many gates as this needs
_MAX_STRIDES = 8  # in a round
_TIMEOUT = 8.0  # [s] after which a change that has not happened is given up
_SAMPLES = 840  # of a round: divisible by any number of strides up to `_MAX_STRIDES`
_MAX_ROW_STEP = 1.0  # [rad] between rows, five times the largest of captures: no spline follows larger steps
_STRIDE_TOLERANCE = 0.02  # [rad], [m] within which strides of one clip count as equal
_ROW_SHAPE = (-1, N_TANGENT)  # of a cached change: any number of rows


class _Passage(NamedTuple):
    """A transition by decaying offsets.

    Attributes
    ----------
    poses : Array, shape (n, nq)
        The transition with `_CONTEXT` seconds of context on either side, at `FPS` frames a second.
    second : Array, shape (n, nq)
        The new clip alone at the same times, placed where the figure is after the change.
    gate : float
        Phase at which the transition begins, after the start of the round [s].
    """

    poses: Array
    second: Array
    gate: float

    @property
    def core(self) -> slice:
        """Rows of the transition, without the context."""
        return slice(round(_CONTEXT * FPS), len(self.poses) - round(_CONTEXT * FPS))

    def clip(self) -> Clip:
        """The transition without the context."""
        return Clip(self.poses[self.core], FPS, "change")

    def stances(self) -> Stances:
        """Stances of the transition, detected with the context."""
        whole, core = Clip(self.poses, FPS, "change"), self.core
        found = stances(whole, whole)
        return Stances(
            found.standing[core], found.pushing[core], found.places[core], found.sliding[core], found.kept[core]
        )


class _Gate(NamedTuple):
    """Where a transition is sought: its two rivers, part of the stride, strides in a round, and moments to try [s]."""

    first: int
    second: int
    part: int
    strides: int
    moments: Array

    @property
    def name(self) -> str:
        return f"change-{self.first}-{self.second}-{self.part}"


def with_changes(haptic_map: RiverClips, blend: float, figure: mujoco.MjModel) -> RiverClips:
    """The same map with feasible transitions between its clips; needs compiled code. Transitions found are cached.

    Parameters
    ----------
    haptic_map : RiverClips
        Map whose rivers have laps of equal duration.
    blend : float
        Duration of the transition by offsets from which the search begins [s].
    figure : mujoco.MjModel
        Model of the figure alone.
    """
    rivers, one_river = range(len(haptic_map.curves)), haptic_map.on_one_river()
    made_of = (haptic_map.compiled().params, np.array([blend]))
    gates: list[_Gate] = []
    for first, second in ((a, b) for a in rivers for b in rivers if a != b):
        strides = _stride_count(one_river, first, second)
        stride = haptic_map.round_seconds(first) / strides
        parts = max(min(int(np.ceil(stride / _TARGET_WAIT_TIME)), _MAX_GATES), int(np.ceil(stride / _MAX_WAIT_TIME)))
        span = stride / parts
        gates += [
            _Gate(first, second, k, strides, span * (k + np.arange(_N_MOMENTS) / _N_MOMENTS)) for k in range(parts)
        ]
    missing = [gate for gate in gates if not is_cached(__name__, gate.name, made_of, _ROW_SHAPE)]
    if missing:
        with working("making rivers' changes feasible", len(missing)):
            run_in_workers([(_cached_change, (one_river, made_of, blend, figure, gate)) for gate in missing])
    changes: list[ClipChange] = []
    for gate in gates:
        rows, period = _cached_change(one_river, made_of, blend, figure, gate), haptic_map.round_seconds(gate.first)
        if len(rows):
            phases = (rows[0, 0] + period / gate.strides * np.arange(gate.strides)) % period
            changes.append(ClipChange(gate.first, gate.second, phases, rows[1:]))
    return haptic_map.with_changes(changes)


def _cached_change(
    haptic_map: RiverClips, made_of: tuple[Array, Array], blend: float, figure: mujoco.MjModel, gate: _Gate
) -> Array:
    """Result of `_change`, cached under the data of which the map is made."""

    def find() -> Array:
        return _change(haptic_map, blend, figure, gate.first, gate.second, gate.moments)

    return cached_array(__name__, gate.name, made_of, _ROW_SHAPE, find)


def _stride_count(haptic_map: RiverClips, first: int, second: int) -> int:
    """Number of equal strides into which a round of both clips divides."""
    rounds = [
        _clip_poses(haptic_map, river, np.arange(_SAMPLES) * haptic_map.round_seconds(river) / _SAMPLES)[:, 7:]
        for river in (first, second)
    ]
    for strides in range(_MAX_STRIDES, 1, -1):
        if all(
            np.abs(whole - np.roll(whole, _SAMPLES // strides, axis=0)).max() < _STRIDE_TOLERANCE for whole in rounds
        ):
            return strides
    return 1


def _clip_poses(haptic_map: RiverClips, river: int, phases: Array, memory: Array | None = None) -> Array:
    """Poses of a river's clip at phases [s] after the start of the round, beginning with a given memory of the map."""
    curve = haptic_map.curves[river]
    start_memory = _memory_at(haptic_map, phases[0]) if memory is None else memory.copy()
    start_memory[ACTIVE_RIVER] = river
    return map_poses(haptic_map, stylus_path(curve.point(curve.start + phases % curve.duration)), start_memory)


def _memory_at(haptic_map: RiverClips, phase: float) -> Array:
    """Memory of a run that begins at a phase [s] after the start of the round."""
    memory, start = haptic_map.compiled().memory, haptic_map.curves[0].start
    memory[HAND_PHASE] = start + phase % haptic_map.round_seconds(0)
    return memory


def _make_passage(
    haptic_map: RiverClips, blend: float, figure: mujoco.MjModel, first: int, second: int, moment: float
) -> _Passage | None:
    """The transition from one river's clip to another's at or soon after a moment of the round [s]; None if none."""
    curve, period = haptic_map.curves[first], haptic_map.round_seconds(first)
    lap = curve.duration
    begin = period + moment - _TIME_BEFORE - _CONTEXT - _SETTLING
    times = begin + np.arange(_BLOCK * round(_TIMEOUT * FPS / _BLOCK)) / FPS
    stylus = stylus_path(curve.point(curve.start + times % lap))
    traces, poses = np.zeros((len(times), TRACE_SIZE)), np.empty((len(times), haptic_map.nq))
    traces[:, TRACE_RIVER] = np.where(times < period + moment, first, second)
    traces[:, TRACE_PHASE] = curve.start + times % lap
    compiled = haptic_map.compiled()._replace(memory=_memory_at(haptic_map, times[0]))
    compiled.memory[ACTIVE_RIVER] = first
    reference = make_reference(figure, compiled, 1.0 / FPS, _BANDWIDTH, blend, packed_legs(figure))
    changed, tail = None, round((_TIME_AFTER + _CONTEXT) * FPS)
    for k in range(0, len(times) - tail, _BLOCK):
        part = slice(k, k + _BLOCK)
        reference_along(reference, stylus[part], traces[part], poses[part])
        changed = k if changed is None and reference.memory[ACTIVE_RIVER] == second else changed
        if changed is not None and reference.transition.since[0] >= reference.transition.duration[0]:
            rest = slice(part.stop, part.stop + tail)
            reference_along(reference, stylus[rest], traces[rest], poses[rest])
            rows = np.arange(changed - round((_TIME_BEFORE + _CONTEXT) * FPS), rest.stop)
            second_poses = _clip_poses(haptic_map, second, times[rows[::-1]], reference.memory)[::-1]
            return _Passage(poses[rows], second_poses, float((times[rows[0]] + _CONTEXT) % period))
    return None


def _change(
    haptic_map: RiverClips, blend: float, figure: mujoco.MjModel, first: int, second: int, moments: Array
) -> Array:
    """The gate [s] as a first row, then the offsets (n, 57) of the transition that begins there; (0, 57) if none."""
    passages = [_make_passage(haptic_map, blend, figure, first, second, float(moment)) for moment in moments]
    longest = MAX_CHANGE_FRACTION * haptic_map.round_seconds(first)
    usable = [passage for passage in passages if passage is not None and passage.clip().duration < longest]
    if not usable:
        return np.zeros((0, N_TANGENT))
    usable.sort(key=lambda passage: contact_forces(passage.clip(), passage.stances(), passage=True).residual)
    candidates: list[tuple[_Passage, Feasible]] = []
    for passage in usable[:_MAX_TRIES]:
        candidates.append((passage, feasible(passage.clip(), passage.stances(), _ITERATIONS, FPS, passage=True)))
        if candidates[-1][1].costs[-1] < _GOOD_COST:
            break
    best, changed = min(candidates, key=lambda found: found[1].costs[-1])
    poses, core = best.poses.copy(), best.core
    poses[core] = changed.clip.poses
    shown = slice(core.start - round(LEAD_IN * FPS), core.stop)
    offsets = _pose_offsets(best.second[shown], poses[shown])
    # Offsets at the end are only due to the lag of the stylus filter: fade them out.
    left = np.arange(len(offsets))[::-1] / (0.5 * _TIME_AFTER * FPS)
    offsets *= np.array([smooth_step.py_func(x) for x in left])[:, None]
    if np.abs(np.diff(offsets, axis=0)).max() > _MAX_ROW_STEP:
        return np.zeros((0, N_TANGENT))
    return np.vstack([np.full((1, N_TANGENT), best.gate), offsets])


def _pose_offsets(second: Array, shown: Array) -> Array:
    """Offsets (n, 57) from poses of the second clip to the poses shown, as `clip_change` adds them."""
    n = len(second)
    turns = [poses[:, 3:].reshape(n, -1, 4) for poses in (second, shown)]
    away = quaternions.rotated(quaternions.conjugate(turns[0][:, 0]), shown[:, :3] - second[:, :3])
    between = quaternions.continuous_logarithm(quaternions.product(quaternions.conjugate(turns[0]), turns[1]))
    return np.hstack([away, between.reshape(n, -1)])
