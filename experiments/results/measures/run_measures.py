"""Measures of a run, computed from its recording block by block in constant memory."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from controllers.safety.faults import Fault, LatchedFault
from experiments.results.folder import has_animation, scene_of
from experiments.results.measures.arm_summary import arm_summary
from experiments.results.measures.blocks import BLOCK_FRAMES, BLOCK_ROWS, ROWS
from experiments.results.measures.changes import river_changes
from experiments.results.measures.figure_measure import FigureMeasure, MeanSquare
from experiments.results.measures.laps import counted_rivers, lap_durations, lap_steps
from experiments.results.measures.oscillation import oscillation_summary
from experiments.results.measures.soles import Soles
from experiments.results.measures.summary import RunSummary
from experiments.results.measures.summary_parts import (
    AnimationSummary,
    FigureSummary,
    PathSummary,
    PushSummary,
    ReplaySummary,
    SpeedSummary,
    TankSummary,
    TraceSummary,
)
from geometry.arrays import Array, IntArray, Mask
from geometry.spans import spans
from models.mocap.motion.clip import pose_difference
from sim.recording.recording import Recording

Span = tuple[float, float]
"""Start and end of a span of time [s]."""

SETTLING_TIME = 1.0  # [s] after the start or after a push, until a relaxed hand has settled on the curve
MIN_PUSH_FORCE = 1e-3  # [N] force above which the hand counts as pushing
STANDSTILL_RADIUS = 1e-3  # [m] of motion within which the stylus counts as standing still
SOLES_RATE = 100.0  # [Hz] at which the animation's soles are sampled
_ROUNDING = 1e-6  # [s] by which times of ticks differ from those of what the hand is to do then
_PACE_TIME = 0.1  # [s] over which the hand's pace is averaged
_TICK_CHANNELS = ("t", "p", "nearest", "distance", "phase", "river", "user", "tank", "tank_scale")
_FRAME_CHANNELS = ("t", "reference", "joint_error", "root_error", "residual", "ground", "flight", "down", "saturated")


def summarise(
    recording: Recording,
    default_poses: Callable[[Array, Array, Array], Array],
    speed: SpeedSummary,
    warnings: dict[str, int],
    handled: Sequence[Span] = (),
) -> RunSummary:
    """Measure a run in constant memory.

    Parameters
    ----------
    recording : Recording
        Recording with the channels of `sim.loop.channels.groups`, and the arrays ``curve_span`` (first and last phase),
        ``curve_closed``, ``clip_seconds`` (duration of a lap at the own pace of the legs' clips, NaN where a lap plays
        no clip), ``clip_laps`` (the same of each clip that is played), ``scene``, ``body_weight`` and ``com_height``;
        ``river_laps`` (duration of a lap of each river, if one at a time has the hand), and ``river_clip_laps`` (that
        at the own pace of its clip) if rivers play clips of their own.
    default_poses : callable
        Poses of the map on the given, unedited curve, from nearest points (k, 3), phases (k,) and rivers (k,); called
        in order of time.
    speed, warnings
        Copied into the summary.
    handled : sequence of Span
        Times in which the hand does something other than pushing: it grabs, traces or leads.
    """
    path, animation, figure, tank = measure_span(recording, default_poses, (0.0, math.inf), handled)
    return RunSummary(
        path, animation, figure, tank, speed, warnings, faults=fault_lines(recording), changes=river_changes(recording),
        oscillation=oscillation_summary(recording), trace=_replay_summary(recording),
        arm=arm_summary(recording) if "tool" in recording.groups["frames"] else None,
    )  # fmt: skip


def measure_span(
    recording: Recording, default_poses: Callable[[Array, Array, Array], Array], span: Span,
    handled: Sequence[Span] = (),
) -> tuple[PathSummary, AnimationSummary | None, FigureSummary | None, TankSummary]:  # fmt: skip
    """Measure the part of a run between two times; the other arguments are those of `summarise`.

    The animation is None in a run without a figure, the figure None if it is not simulated physically.
    """
    path = PathMeasure(recording, span[0], handled)
    animation = AnimationMeasure(recording, span[0])
    figure = FigureMeasure(recording)
    tank = TankSummary(math.inf, 0)
    physical, shown = "joint_error" in recording.groups["frames"], has_animation(recording)
    per_frame = round(recording.rates["ticks"] / recording.rates["frames"])
    rate, last = recording.rates["frames"], len(recording.channel("frames", "t"))
    begin, end = (last if at * rate >= last else math.ceil(at * rate - 1e-9) for at in span)
    for start in range(begin, end, BLOCK_FRAMES):
        stop = min(start + BLOCK_FRAMES, end)
        rows = slice(start * per_frame, stop * per_frame)
        ticks = {name: channel[rows] for name, channel in recording.groups["ticks"].items() if name in _TICK_CHANNELS}
        frames = {
            name: channel[start:stop] for name, channel in recording.groups["frames"].items() if name in _FRAME_CHANNELS
        }
        pushed = path.add(ticks)
        if shown:
            default = default_poses(*(ticks[name][::per_frame] for name in ("nearest", "phase", "river")))
            animation.add(frames, default, pushed[::per_frame])
        if physical:
            figure.add(frames)
        least = min(tank.least_mj, 1e3 * float(ticks["tank"].min()))
        tank = TankSummary(least, tank.scaled_ticks + int(np.sum(ticks["tank_scale"] < 1.0)))
    return path.summary(), animation.summary() if shown else None, figure.summary() if physical else None, tank


def trace_summary(recording: Recording) -> TraceSummary:
    """Measure a hand that traces the curve."""
    ticks, force = recording.groups["ticks"], 0.0
    for first in range(0, len(ticks["t"]), BLOCK_ROWS):
        force = max(force, float(np.linalg.norm(ticks["user"][first : first + BLOCK_ROWS], axis=1).max()))
    away = _deviation(recording, SETTLING_TIME)
    return TraceSummary(1e3 * away.root if away.count else None, force)


def _replay_summary(recording: Recording) -> ReplaySummary | None:
    if "replayed" not in recording.texts:
        return None
    away = _deviation(recording, 0.0)
    return ReplaySummary(recording.texts["replayed"], 1e3 * away.root, recording.texts["distance_from"])


def _deviation(recording: Recording, since: float) -> MeanSquare:
    """Distance of the stylus from the curve from the time `since` [s] on [m]."""
    ticks, distance = recording.groups["ticks"], MeanSquare()
    for first in range(0, len(ticks["t"]), BLOCK_ROWS):
        rows = slice(first, first + BLOCK_ROWS)
        distance.add(ticks["distance"][rows][ticks["t"][rows] >= since])
    return distance


class PathMeasure:
    """`PathSummary` of ticks that are given in blocks, from the time `since` [s] on; `handled` as for `summarise`."""

    def __init__(self, recording: Recording, since: float = 0.0, handled: Sequence[Span] = ()):
        self._since, self._handled = since, tuple(handled)
        self._closed = bool(recording.arrays["curve_closed"])
        self._spans = lap_durations(recording)
        self._left_alone = MeanSquare()
        self._last: tuple[float, int] | None = None  # phase and river
        self._clip_seconds = float(recording.arrays["clip_seconds"])
        self._clip_laps = recording.arrays.get("clip_laps", np.array([self._clip_seconds]))
        self._own_clips = recording.arrays.get("river_clip_laps")
        own = np.full(len(self._spans) - 1, self._clip_seconds) if self._own_clips is None else self._own_clips
        self._clips = np.append(own, self._clip_seconds)
        self._laps, self._clip_travelled, self._start_time, self._last_time = 0.0, 0.0, 0.0, 0.0
        self._pace_ticks, self._ticks = max(1, round(_PACE_TIME * recording.rates["ticks"])), 0
        self._travelled: list[float] = []  # time travelled in the clips [s], every `_PACE_TIME`
        self._anchor, self._last_move_time = np.full(3, np.inf), 0.0
        self._last_push_time = -math.inf
        self._replayed = "replayed" in recording.texts
        self._pushes: list[PushSummary] = []
        self._pushing, self._push_origin = False, np.zeros(3)
        self._has_curve = False  # whether the field had a curve at any tick

    def add(self, ticks: Mapping[str, Array]) -> Mask:
        """Add a block; returns at which ticks the hand pushes, or has pushed within the last `SETTLING_TIME`."""
        t, size = ticks["t"], np.linalg.norm(ticks["user"], axis=1)
        at_work = size > MIN_PUSH_FORCE
        last = np.maximum.accumulate(np.where(at_work, t, self._last_push_time))
        pushed = (t - last <= SETTLING_TIME) | self._replayed  # a replayed hand is never left alone
        self._last_push_time = float(last[-1])
        along = np.isfinite(ticks["distance"])  # infinite for a law without a curve
        self._has_curve |= bool(along.any())
        self._left_alone.add(ticks["distance"][(t >= self._since + SETTLING_TIME) & ~pushed & along])
        self._add_phase(t, ticks["phase"], counted_rivers(ticks["river"], self._spans))
        self._add_position(t, ticks["p"])
        handled = np.any([(start - _ROUNDING <= t) & (t <= end + _ROUNDING) for start, end in self._handled], axis=0)
        self._add_pushes(ticks, size, at_work & ~handled)
        return pushed

    def _add_position(self, t: Array, p: Array) -> None:
        """Update the time at which the stylus last moved by more than `STANDSTILL_RADIUS`."""
        k = 0
        while k < len(t):
            far = np.linalg.norm(p[k:] - self._anchor, axis=1) > STANDSTILL_RADIUS
            if not far.any():
                return
            k += int(np.argmax(far))
            self._anchor, self._last_move_time = p[k].copy(), float(t[k])

    def _add_phase(self, t: Array, phase: Array, river: IntArray) -> None:
        if self._last is None:
            self._last, self._start_time = (float(phase[0]), int(river[0])), float(t[0])
        steps = lap_steps(np.append(self._last[0], phase), np.append(self._last[1], river), self._spans, self._closed)
        travelled = self._clip_travelled + np.cumsum(steps * self._clips[river])
        self._travelled += travelled[-self._ticks % self._pace_ticks :: self._pace_ticks].tolist()
        self._ticks += len(steps)
        self._laps += float(np.sum(steps))
        self._clip_travelled = float(travelled[-1])
        self._last, self._last_time = (float(phase[-1]), int(river[-1])), float(t[-1])

    def _add_pushes(self, ticks: Mapping[str, Array], size: Array, at_work: Mask) -> None:
        for first, last in spans(at_work):
            block = slice(first, last)
            if not (first == 0 and self._pushing):
                self._push_origin = ticks["p"][first].copy()
            along = np.isfinite(ticks["distance"][block])
            away = ticks["p"][block] - np.where(along[:, None], ticks["nearest"][block], self._push_origin)
            distance = np.linalg.norm(away, axis=1)
            k = int(np.argmax(distance))
            cosine = float(away[k] @ ticks["user"][block][k] / max(distance[k] * size[block][k], 1e-12))
            t = ticks["t"][block]
            push = PushSummary(
                float(t[0]), float(t[-1] - t[0]), float(np.max(size[block])), 1e3 * float(distance[k]), cosine
            )
            if first == 0 and self._pushing:
                push = _join_pushes(self._pushes.pop(), push)
            self._pushes.append(push)
        self._pushing = bool(at_work[-1])

    def summary(self) -> PathSummary:
        """The measures of all blocks added so far."""
        laps, seconds = self._laps, self._last_time - self._start_time
        lap_seconds = seconds / laps if laps >= 1.0 else None
        stopped = self._last_move_time if self._last_time - self._last_move_time >= SETTLING_TIME else None
        moving = (seconds if stopped is None else stopped - self._start_time) or math.inf
        pace = None if math.isnan(self._clip_seconds) or not self._has_curve else self._clip_travelled / moving
        paces = () if pace is None else tuple((laps * self._clip_laps / moving).tolist())
        if pace is not None and self._own_clips is not None:
            paces = (pace,)
        alone, most = (
            (1e3 * self._left_alone.root, 1e3 * self._left_alone.largest) if self._left_alone.count else (None, None)
        )
        settled = np.diff(self._travelled)[round(SETTLING_TIME / _PACE_TIME) :]
        spread = None
        if pace is not None and stopped is None and len(settled) and settled.mean() > 0.0:
            low, high = np.quantile(settled / settled.mean(), (0.05, 0.95))
            spread = (float(low), float(high)) if low > 0.0 else None
        return PathSummary(alone, most, laps, lap_seconds, tuple(self._pushes), stopped, pace, paces, spread)


def _join_pushes(before: PushSummary, after: PushSummary) -> PushSummary:
    """Join the two parts of a push that crosses the border of two blocks."""
    further = max(before, after, key=lambda push: push.deviation_mm)
    return PushSummary(
        before.start, after.start + after.seconds - before.start, max(before.peak_force, after.peak_force),
        further.deviation_mm, further.along_push,
    )  # fmt: skip


class AnimationMeasure:
    """`AnimationSummary` of frames that are given in blocks, from the time `since` [s] on."""

    def __init__(self, recording: Recording, since: float) -> None:
        self._since, self._soles = since, Soles(scene_of(recording))
        self._stride, self._next_row = max(1, round(recording.rates["frames"] / SOLES_RATE)), 0
        self._pushed, self._unpushed, self._fastest = -math.inf, -math.inf, 0.0
        self._rate: float = recording.rates["frames"]
        self._last_pose: Array | None = None

    def add(self, frames: Mapping[str, Array], default: Array, pushed: Mask) -> None:
        """Add a block of frames, the poses of the map on the curve at these frames, and whether the hand pushes."""
        self._soles.add(frames["reference"][self._next_row :: self._stride])
        self._next_row = (self._next_row - len(default)) % self._stride
        poses = frames["reference"]
        before = np.vstack((poses[:1] if self._last_pose is None else self._last_pose, poses[:-1]))
        steps = pose_difference(poses, before)[:, 6:].reshape(len(poses), -1, 3)
        self._fastest = max(self._fastest, self._rate * float(np.max(np.linalg.norm(steps, axis=2), initial=0.0)))
        self._last_pose = poses[-1:].copy()
        turns = pose_difference(default, frames["reference"])[:, 6:].reshape(len(default), -1, 3)
        largest = np.max(np.linalg.norm(turns, axis=2), axis=1)
        settled = frames["t"] >= self._since + SETTLING_TIME
        self._pushed = float(np.max(largest[pushed], initial=self._pushed))
        self._unpushed = float(np.max(largest[settled & ~pushed], initial=self._unpushed))

    def summary(self) -> AnimationSummary:
        """The measures of all blocks added so far."""
        lowest = 100.0 * self._soles.lowest if math.isfinite(self._soles.lowest) else 0.0
        pushed, unpushed = (
            math.degrees(turn) if math.isfinite(turn) else None for turn in (self._pushed, self._unpushed)
        )
        return AnimationSummary(pushed, unpushed, lowest, 100.0 * self._soles.slide, self._fastest)


def fault_lines(recording: Recording) -> tuple[str, ...]:
    """A line for each latched fault, in order of time, and one for the ticks that came late."""
    ticks = recording.groups["ticks"]
    if "fault" not in ticks:
        return ()
    lines: list[str] = []
    before, gaps = 0.0, 0
    for first in range(0, len(ticks["t"]), ROWS):
        rows = slice(first, first + ROWS)
        codes, gaps = ticks["fault"][rows], int(ticks["gaps"][rows][-1])
        changes = np.flatnonzero(np.diff(codes, prepend=before) != 0.0)
        for row in changes[codes[changes] != 0.0]:
            t, value = float(ticks["t"][rows][row]), float(ticks["fault_value"][rows][row])
            lines.append(LatchedFault(Fault(int(codes[row])), t, value).line())
        before = float(codes[-1])
    if gaps:
        lines.append(f"The servo was late {gaps} times; the force was released and ramped in again.")
    return tuple(lines)
