"""Dynamically feasible transitions between the clips of different rivers, computed before a run.

A transition by decaying offsets and quick steps (`sim.reference.river_changes`) needs a residual force of 13 to 25 % of
body weight, and the figure may fall. It serves as the initial guess only: such transitions are generated at several
moments of the stride and ranked by residual. The best are made feasible from 0.7 s before the change to 0.9 s after it,
as a capture is (`models.mocap.preparation.feasible`); both ends stay equal to the clips.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from controllers.easing import smooth_step
from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.haptic_map.clip_change import FPS, LEAD_IN, ClipChange
from controllers.haptic_map.river_clips import LONGEST, RiverClips
from controllers.haptic_map.river_memory import PHASE, RIVER
from controllers.state import Array, stylus_path
from experiments.console.progress import working
from experiments.files.array_cache import is_kept, kept_array
from experiments.fitting.figure_legs import packed_legs
from models.mocap.motion import quaternions
from models.mocap.motion.clip import Clip
from models.mocap.preparation.feasible import Feasible, borne, feasible
from models.mocap.preparation.stances import Stances, stances
from sim.compilation.side_by_side import side_by_side
from sim.compilation.sources import kept_folder
from sim.reference.reference import make_reference, map_poses, reference_along

_LEAD, _TAIL = 0.7, 0.9  # [s] before and after a change that belong to it and are optimised
_SETTLES, _BANDWIDTH = 1.0, 40.0  # [s] settling time and [Hz] cut-off of the stylus filter, high enough not to show
_AT_ONCE = 6  # frames between two checks whether the clip has changed
_ITERATIONS = 10
_AROUND = 0.5  # [s] of context on either side of a change, from which its stances are detected
_MOMENTS = 8  # moments of a stride at which a change by offsets is tried
# How many of these are made feasible at most, and the cost below which no more are tried. With 12 iterations, three
# tries and waits of 2.4 s, which take longer, eight of eight sets of captures stood; with these numbers seven or
# eight do.
_TRIES, _WELL = 2, 400.0
_WAITS = 2.0  # [s] that a hand waits for the next gate, at most about
_GATES = 3  # gates in a stride at most, unless it is long, since each takes some seconds to compute
_LONGEST_WAIT = 4.0  # [s]: in clips with few strides, gates are as many as this needs
_MOST = 8  # strides in a round at most
_LONG = 8.0  # [s] after which a change that has not happened is given up
_ROWS = 840  # samples of a round: divisible by any number of strides up to `_MOST`
_LEAPS = 1.0  # [rad] from row to row, five times the largest of captures: a rotation vector that no spline can follow
_REPEATS = 0.02  # [rad], [m] by which strides of one clip may differ


class _Passage(NamedTuple):
    """A transition by decaying offsets.

    Attributes
    ----------
    poses : Array, shape (n, nq)
        The transition with `_AROUND` seconds of context on either side, at `FPS` frames a second.
    second : Array, shape (n, nq)
        The new clip alone at the same times, placed where the figure is after the change.
    gate : float
        Phase at which the transition begins, after the start of the round [s].
    """

    poses: Array
    second: Array
    gate: float

    @property
    def own(self) -> slice:
        """Rows of the transition, without the context."""
        return slice(round(_AROUND * FPS), len(self.poses) - round(_AROUND * FPS))

    def clip(self) -> Clip:
        """The transition without the context."""
        return Clip(self.poses[self.own], FPS, "change")

    def stances(self) -> Stances:
        """Stances of the transition, detected with the context."""
        whole, own = Clip(self.poses, FPS, "change"), self.own
        told = stances(whole, whole)
        return Stances(told.standing[own], told.pushing[own], told.places[own], told.sliding[own], told.kept[own])


class _Gate(NamedTuple):
    """Where a transition is sought: its two rivers, a part of a stride, strides in a round, and moments to try [s]."""

    first: int
    second: int
    part: int
    strides: int
    moments: Array

    @property
    def name(self) -> str:
        return f"change-{self.first}-{self.second}-{self.part}"


def with_changes(made: RiverClips, blend: float, figure: mujoco.MjModel) -> RiverClips:
    """The same map with feasible transitions between its clips; needs compiled code. Transitions found are cached.

    Parameters
    ----------
    made : RiverClips
        Map whose rivers have laps of equal duration.
    blend : float
        Duration of the transition by offsets from which the search begins [s].
    figure : mujoco.MjModel
        Model of the figure alone.
    """
    rivers, alike = range(len(made.curves)), made.on_one_river()
    made_of = (made.compiled().params, np.array([blend]))
    gates: list[_Gate] = []
    for first, second in ((a, b) for a in rivers for b in rivers if a != b):
        strides = _strides(alike, first, second)
        stride = made.round_seconds(first) / strides
        parts = max(min(int(np.ceil(stride / _WAITS)), _GATES), int(np.ceil(stride / _LONGEST_WAIT)))
        span = stride / parts
        gates += [_Gate(first, second, k, strides, span * (k + np.arange(_MOMENTS) / _MOMENTS)) for k in range(parts)]
    missing = [gate for gate in gates if not is_kept(kept_folder(__name__), gate.name, made_of, (-1, 57))]
    if missing:
        with working("making rivers' changes feasible", len(missing)):
            side_by_side([(_kept, (alike, made_of, blend, figure, gate)) for gate in missing])
    changes: list[ClipChange] = []
    for gate in gates:
        rows, period = _kept(alike, made_of, blend, figure, gate), made.round_seconds(gate.first)
        if len(rows):
            phases = (rows[0, 0] + period / gate.strides * np.arange(gate.strides)) % period
            changes.append(ClipChange(gate.first, gate.second, phases, rows[1:]))
    return made.with_changes(changes)


def _kept(made: RiverClips, made_of: tuple[Array, Array], blend: float, figure: mujoco.MjModel, gate: _Gate) -> Array:
    """Result of `_found`, cached under the data of which the rivers are made."""

    def find() -> Array:
        return _found(made, blend, figure, gate.first, gate.second, gate.moments)

    return kept_array(kept_folder(__name__), gate.name, made_of, (-1, 57), find)


def _strides(made: RiverClips, first: int, second: int) -> int:
    """Into how many equal strides a round of both clips divides."""
    rounds = [
        _alone(made, river, np.arange(_ROWS) * made.round_seconds(river) / _ROWS)[:, 7:] for river in (first, second)
    ]
    for strides in range(_MOST, 1, -1):
        if all(np.abs(whole - np.roll(whole, _ROWS // strides, axis=0)).max() < _REPEATS for whole in rounds):
            return strides
    return 1


def _alone(made: RiverClips, river: int, phases: Array, memory: Array | None = None) -> Array:
    """Poses of a river's clip at phases [s] after the start of the round, beginning with a given memory of the map."""
    curve, own = made.curves[river], _begun(made, phases[0]) if memory is None else memory.copy()
    own[RIVER] = river
    return map_poses(made, stylus_path(curve.point(curve.start + phases % curve.duration)), own)


def _begun(made: RiverClips, phase: float) -> Array:
    """Memory of a run that begins at a phase [s] after the start of the round."""
    memory, start = made.compiled().memory, made.curves[0].start
    memory[PHASE] = start + phase % made.round_seconds(0)
    return memory


def _passage(
    made: RiverClips, blend: float, figure: mujoco.MjModel, first: int, second: int, moment: float
) -> _Passage | None:
    """The transition from one river's clip to another's at or soon after a moment of the round [s]; None without."""
    curve, period = made.curves[first], made.round_seconds(first)
    lap = curve.duration
    times = period + moment - _LEAD - _AROUND - _SETTLES + np.arange(_AT_ONCE * round(_LONG * FPS / _AT_ONCE)) / FPS
    stylus = stylus_path(curve.point(curve.start + times % lap))
    traces, poses = np.zeros((len(times), TRACE_SIZE)), np.empty((len(times), made.nq))
    traces[:, TRACE_RIVER] = np.where(times < period + moment, first, second)
    traces[:, TRACE_PHASE] = curve.start + times % lap
    compiled = made.compiled()._replace(memory=_begun(made, times[0]))
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
            return _Passage(poses[rows], alone, float((times[rows[0]] + _AROUND) % period))
    return None


def _found(made: RiverClips, blend: float, figure: mujoco.MjModel, first: int, second: int, moments: Array) -> Array:
    """The gate [s] as a first row, then the offsets (n, 57) of the transition that begins there; (0, 57) if none."""
    passages = [_passage(made, blend, figure, first, second, float(moment)) for moment in moments]
    longest = LONGEST * made.round_seconds(first)
    tried = [passage for passage in passages if passage is not None and passage.clip().duration < longest]
    if not tried:
        return np.zeros((0, 57))
    tried.sort(key=lambda passage: borne(passage.clip(), passage.stances(), passage=True).residual)
    made_so: list[tuple[_Passage, Feasible]] = []
    for passage in tried[:_TRIES]:
        made_so.append((passage, feasible(passage.clip(), passage.stances(), _ITERATIONS, FPS, passage=True)))
        if made_so[-1][1].costs[-1] < _WELL:
            break
    best, changed = min(made_so, key=lambda found: found[1].costs[-1])
    poses, own = best.poses.copy(), best.own
    poses[own] = changed.clip.poses
    shown = slice(own.start - round(LEAD_IN * FPS), own.stop)
    offsets = _way(best.second[shown], poses[shown])
    # Offsets at the end are only the lag of the stylus filter: fade them out.
    left = np.arange(len(offsets))[::-1] / (0.5 * _TAIL * FPS)
    offsets *= np.array([smooth_step.py_func(x) for x in left])[:, None]
    if np.abs(np.diff(offsets, axis=0)).max() > _LEAPS:
        return np.zeros((0, 57))
    return np.vstack([np.full((1, 57), best.gate), offsets])


def _way(second: Array, shown: Array) -> Array:
    """Offsets (n, 57) from poses of the second clip to the poses shown, as `clip_change` adds them."""
    n = len(second)
    turns = [poses[:, 3:].reshape(n, -1, 4) for poses in (second, shown)]
    away = quaternions.rotated(quaternions.conjugate(turns[0][:, 0]), shown[:, :3] - second[:, :3])
    between = quaternions.continuous_logarithm(quaternions.product(quaternions.conjugate(turns[0]), turns[1]))
    return np.hstack([away, between.reshape(n, -1)])
