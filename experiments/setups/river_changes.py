"""Changes from river to river that floor contact alone can drive, found before a run.

Where a clip goes over into another by offsets that decay and hasty steps (`sim.reference.river_changes`), a figure
lacks 13 to 25 % of its weight, and may fall. So that is only where the search begins: at some moments of the stride
such a change is tried, and from 0.7 s before it to 0.9 s after it the motion is made feasible as a capture is
(`models.mocap.preparation.feasible`), beginning with what lacks least; both of its ends stay as the clips are.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from controllers.easing import smooth_step
from controllers.fields.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.haptic_map.clip_change import FPS, MARGIN, ClipChange
from controllers.haptic_map.river_clips import LONGEST, RIVER, RiverClips
from controllers.state import Array
from experiments.files.kept import is_kept, kept_array
from experiments.setups.figure_legs import packed_legs
from experiments.setups.stylus import stylus_path
from experiments.working import working
from models.mocap import quaternions
from models.mocap.clip import Clip
from models.mocap.preparation.feasible import Feasible, contact_residual, feasible
from models.mocap.preparation.stances import Stances, stances
from sim.compilation.side_by_side import side_by_side
from sim.compilation.sources import kept_folder
from sim.reference.reference import make_reference, poses_along, reference_along

_LEAD, _TAIL = 0.7, 0.9  # [s] before a change and after it that are its own
_SETTLES, _BANDWIDTH = 1.0, 40.0  # [s], [Hz] of the stylus filter, which is hardly to be seen
_AT_ONCE = 6  # rows between two looks whether the clip has changed
_ITERATIONS = 10
_AROUND = 0.5  # [s] beside the part that is made feasible, by which its stances are told
_MOMENTS = 8  # of a stride, at which a change by offsets is tried
_TRIES, _WELL = 2, 400.0  # of these that are made feasible at most, and the cost at which one is done well
_WAITS = 2.0  # [s] for the next gate, at most about
_GATES = 3  # of a stride at most, for one takes some seconds to find
_MOST = 8  # strides in a lap
_LONG = 8.0  # [s] after which a change is given up
_ROWS = 840  # of a lap: any number of strides up to `_MOST` divides it
_REPEATS = 0.02  # [rad], [m] by which strides of one clip differ


class _Passage(NamedTuple):
    """A change by offsets that decay.

    Attributes
    ----------
    poses : Array, shape (n, nq)
        From `_AROUND` before what is its own to `_AROUND` after, `FPS` a second.
    second : Array, shape (n, nq)
        The new clip alone, where it then is.
    gate : float
        Phase at which its own begins, after the start of the lap [s].
    """

    poses: Array
    second: Array
    gate: float

    @property
    def own(self) -> slice:
        """Rows that are its own."""
        return slice(round(_AROUND * FPS), len(self.poses) - round(_AROUND * FPS))

    def clip(self) -> Clip:
        """What is its own."""
        return Clip(self.poses[self.own], FPS, "change")

    def stances(self) -> Stances:
        """Its stances, told with what is beside it."""
        whole, own = Clip(self.poses, FPS, "change"), self.own
        told = stances(whole, whole)
        return Stances(told.standing[own], told.pushing[own], told.places[own], told.sliding[own])


class _Gate(NamedTuple):
    """Where a change is sought: from river to river, in a part of one of a lap's strides, at moments of it [s]."""

    first: int
    second: int
    part: int
    strides: int
    moments: Array

    @property
    def name(self) -> str:
        return f"change-{self.first}-{self.second}-{self.part}"


def with_changes(made: RiverClips, blend: float, figure: mujoco.MjModel) -> RiverClips:
    """The same map, whose clips go over into each other by feasible changes; needs compiled code, and they are kept.

    Parameters
    ----------
    made : RiverClips
        Whose rivers have laps of one duration.
    blend : float
        Time in which one clip goes over into another where the search begins [s].
    figure : mujoco.MjModel
        The figure alone.
    """
    rivers, alike = range(len(made.curves)), made.on_one_river()
    made_of = (made.compiled().params, np.array([blend]))
    gates: list[_Gate] = []
    for first, second in ((a, b) for a in rivers for b in rivers if a != b):
        lap, strides = made.curves[first].duration, _strides(alike, first, second)
        parts = min(int(np.ceil(lap / strides / _WAITS)), _GATES)
        span = lap / strides / parts
        gates += [_Gate(first, second, k, strides, span * (k + np.arange(_MOMENTS) / _MOMENTS)) for k in range(parts)]
    missing = [gate for gate in gates if not is_kept(kept_folder(__name__), gate.name, made_of, (-1, 57))]
    if missing:
        with working("making rivers' changes feasible", len(missing)):
            side_by_side([(_kept, (alike, made_of, blend, figure, gate)) for gate in missing])
    changes: list[ClipChange] = []
    for gate in gates:
        rows, lap = _kept(alike, made_of, blend, figure, gate), made.curves[gate.first].duration
        if len(rows):
            phases = (rows[0, 0] + lap / gate.strides * np.arange(gate.strides)) % lap
            changes.append(ClipChange(gate.first, gate.second, phases, rows[1:]))
    return made.with_changes(changes)


def _kept(made: RiverClips, made_of: tuple[Array, Array], blend: float, figure: mujoco.MjModel, gate: _Gate) -> Array:
    """What `_found` gives, kept under what the rivers are made of."""

    def find() -> Array:
        return _found(made, blend, figure, gate.first, gate.second, gate.moments)

    return kept_array(kept_folder(__name__), gate.name, made_of, (-1, 57), find)


def _strides(made: RiverClips, first: int, second: int) -> int:
    """In how many equal parts a lap of both clips falls."""
    laps = [
        _alone(made, river, np.arange(_ROWS) * made.curves[river].duration / _ROWS)[:, 7:] for river in (first, second)
    ]
    for strides in range(_MOST, 1, -1):
        if all(np.abs(lap - np.roll(lap, _ROWS // strides, axis=0)).max() < _REPEATS for lap in laps):
            return strides
    return 1


def _alone(made: RiverClips, river: int, phases: Array, memory: Array | None = None) -> Array:
    """Poses of a river's clip at phases after the start of the lap, from a memory on."""
    kind, params, fresh = made.compiled()
    memory = fresh.copy() if memory is None else memory.copy()
    memory[RIVER] = river
    curve, poses = made.curves[river], np.empty((len(phases), made.nq))
    poses_along(kind, params, memory, stylus_path(curve.point(curve.start + phases % curve.duration)), poses)
    return poses


def _passage(
    made: RiverClips, blend: float, figure: mujoco.MjModel, first: int, second: int, moment: float
) -> _Passage | None:
    """A clip that goes over into another's at a moment of the lap [s] or soon after; None if it does not."""
    curve = made.curves[first]
    lap = curve.duration
    times = lap + moment - _LEAD - _AROUND - _SETTLES + np.arange(_AT_ONCE * round(_LONG * FPS / _AT_ONCE)) / FPS
    stylus = stylus_path(curve.point(curve.start + times % lap))
    traces, poses = np.zeros((len(times), TRACE_SIZE)), np.empty((len(times), made.nq))
    traces[:, TRACE_RIVER] = np.where(times < lap + moment, first, second)
    traces[:, TRACE_PHASE] = curve.start + times % lap
    compiled = made.compiled()
    compiled.memory[RIVER] = first
    reference = make_reference(figure, compiled, 1.0 / FPS, _BANDWIDTH, blend, packed_legs(figure))
    changed, tail = None, round((_TAIL + _AROUND) * FPS)
    for k in range(0, len(times) - tail, _AT_ONCE):
        part = slice(k, k + _AT_ONCE)
        reference_along(reference, stylus[part], traces[part], poses[part])
        changed = k if changed is None and reference.memory[RIVER] == second else changed
        if changed is not None and reference.transition.since[0] >= reference.transition.lasts[0]:
            rest = slice(part.stop, part.stop + tail)
            reference_along(reference, stylus[rest], traces[rest], poses[rest])
            rows = np.arange(changed - round((_LEAD + _AROUND) * FPS), rest.stop)
            alone = _alone(made, second, times[rows[::-1]], reference.memory)[::-1]
            return _Passage(poses[rows], alone, float((times[rows[0]] + _AROUND) % lap))
    return None


def _found(made: RiverClips, blend: float, figure: mujoco.MjModel, first: int, second: int, moments: Array) -> Array:
    """A row with the gate [s], and the offsets (n, 57) of a change that begins there; none if none is found."""
    passages = [_passage(made, blend, figure, first, second, float(moment)) for moment in moments]
    longest = LONGEST * made.curves[first].duration
    tried = [passage for passage in passages if passage is not None and passage.clip().duration < longest]
    if not tried:
        return np.zeros((0, 57))
    tried.sort(key=lambda passage: contact_residual(passage.clip(), passage.stances(), passage=True))
    made_so: list[tuple[_Passage, Feasible]] = []
    for passage in tried[:_TRIES]:
        made_so.append((passage, feasible(passage.clip(), passage.stances(), _ITERATIONS, FPS, passage=True)))
        if made_so[-1][1].costs[-1] < _WELL:
            break
    best, changed = min(made_so, key=lambda found: found[1].costs[-1])
    poses, own = best.poses.copy(), best.own
    poses[own] = changed.clip.poses
    shown = slice(own.start - round(MARGIN * FPS), own.stop)
    offsets = _way(best.second[shown], poses[shown])
    # What is left of the filter's lag.
    left = np.arange(len(offsets))[::-1] / (0.5 * _TAIL * FPS)
    offsets *= np.array([smooth_step.py_func(x) for x in left])[:, None]
    return np.vstack([np.full((1, 57), best.gate), offsets])


def _way(second: Array, shown: Array) -> Array:
    """Offsets (n, 57) from poses of the second clip to those that are shown, as `clip_change` adds them."""
    n = len(second)
    turns = [poses[:, 3:].reshape(n, -1, 4) for poses in (second, shown)]
    away = quaternions.rotated(quaternions.conjugate(turns[0][:, 0]), shown[:, :3] - second[:, :3])
    between = quaternions.logarithm(quaternions.product(quaternions.conjugate(turns[0]), turns[1]))
    return np.hstack([away, between.reshape(n, -1)])
