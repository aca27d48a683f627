r"""The part of a capture that repeats itself: a cycle, or half a stride whose mirror image continues it.

The distance d of two frames is that of `laps`. A part of the clip is its cycle if its ends are similar, with feet that
stand at both in one place relative to the root, and the rest of the clip only repeats it, its turns included.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import Array, IntArray, Mask
from models.mocap.dynamics.contacts import contacts
from models.mocap.motion.clip import Clip
from models.mocap.motion.mirror import mirrored
from models.mocap.preparation.laps import MAX_FOOT_GAP, MIN_LAP_TRAVEL, best_lap, foot_gaps, frame_distances

# Largest d between the ends of a gait cycle, and of a cycle in place [rad]; walks have 0.1 to 0.3. Half the first loops
# two of 17 captures differently, twice the first loops one; half the second changes none, twice the second takes a
# backflip and two kicks for cycles.
_MAX_GAIT_GAP, _MAX_IN_PLACE_GAP = 0.38, 0.30
# Fraction of the clip's frames that must have a frame of the cycle within this d [rad]. A fraction of 0.5 loops all of
# 19 captures the same way, 0.9 one differently; half of d leaves CMU 01_01 open, twice takes a dance for a cycle.
_MIN_COVERED_FRACTION, _MAX_COVERED_DISTANCE = 0.7, 0.35
# A frame further than this d from all of the cycle is another motion [rad], such as a jump in a walk, of which a cycle
# may leave out this fraction of the clip. Of 77 cycles 8 left out such frames, 3 of them more (smash, punch, tennis).
_MAX_UNLIKE_DISTANCE, _MAX_UNLIKE_FRACTION = 0.6, 0.05
# So is a frame of which some joint is turned further than this from it in every frame of the cycle [rad]: d is a mean
# over joints, in which one arm raised by 80° counts as 0.33. Of 44 cycles ten are of gestures that left out 17 to 47 %
# of the clip, the others at most 2 %; with 45° three jumps and walks would be open, with 75° four gestures cycles.
_MAX_JOINT_TURN = np.deg2rad(60.0)
# Frames with half of such a turn are told to be left out: the cycles of four of 126 gestures have 0.8 to 0.9 s of them,
# of 26 other cycles only those have 0.5 s of which d tells as much.
_TOLD_JOINT_TURN = np.deg2rad(30.0)
# Largest difference of a frame's yaw rate, its mean over the cycle's duration, from the cycle's [rad/s]: a walk along a
# curve is a cycle, a turn in a straight walk is not. Half leaves 11 of 156 captures open, among them runs; with twice
# the cycles of eight lose their turns.
_MAX_YAW_RATE_DIFFERENCE = np.deg2rad(20.0)
# Least mean speed of a cycle relative to the clip's: standing still is no cycle. Half loops 19 captures the same way.
_MIN_SPEED_RATIO = 0.7
# Largest d between the end of half a stride and its mirrored start [rad]: a run has 0.18, a third of a stride 0.3.
# Twice changes none of 17 captures, half leaves a run open.
_MAX_MIRRORED_GAP = 0.25
_MIN_HALF_STRIDE_TIME = 0.25  # least duration of half a stride [s]: sprinters take 0.22
# Largest ratio, either way, of a lap's duration to that of half a stride if it holds one of them: nearer to one than to
# two. Of 61 laps of windows of twelve gaits that hold less than a stride 48 are found; none of 140 that hold one is
# taken for half, and none of 69 of windows of jumps, side skips and a walk with turns.
_MAX_DURATION_RATIO = 2.0**0.5
_MIN_CYCLE_TIME = 0.6  # least duration of a cycle in place [s]: half or twice loops all of 19 captures the same way
# Least duration of a cycle in place as a fraction of the clip's: shorter ones are tremor. Half loops all of 19 captures
# the same way, twice one of them differently.
_MIN_CYCLE_FRACTION = 0.3
# Approximate number of frames that are compared with each other: a matrix takes 2 MB. Half or twice loops 17 captures
# the same way.
_COMPARED_FRAMES = 500


class LeftOut(NamedTuple):
    """Time for which a capture is unlike all of its cycle, and when it first is [s]."""

    seconds: float
    since: float


class Cycle(NamedTuple):
    """First and last frame of the part that a clip repeats, d between them, and `left_out`."""

    first: int
    last: int
    gap: float
    left_out: LeftOut


class HalfStride(NamedTuple):
    """First and last frame of half a stride, and d from its mirrored start to its end and to its start."""

    first: int
    last: int
    gap: float
    asymmetry: float


def find_cycle(clip: Clip) -> Cycle | None:
    """The part that the clip repeats: a gait cycle, or else a cycle in place."""
    frame_step = -(-clip.n_frames // _COMPARED_FRAMES)
    frames = np.arange(0, clip.n_frames, frame_step)
    distances, headings = frame_distances(clip, frames)
    lap = best_lap(clip)
    speeds = np.sqrt(np.mean(clip.velocities()[frames, 6:] ** 2, axis=1))

    def repeated(start: int, end: int, gap: float, max_gap: float) -> Cycle | None:
        """The part from start to end if its ends are similar and the rest of the clip repeats it."""
        inside = (frames >= start) & (frames <= end)
        if inside.sum() < 2:
            return None  # shorter than two steps of the comparison
        yaw_rate = np.diff(headings[inside][[0, -1]]) / (frames[inside][-1] - frames[inside][0])
        nearest = distances[:, inside].min(axis=1)
        turns = _least_joint_turns(clip.poses[frames], inside)
        gesture, unlike = turns > _MAX_JOINT_TURN, (nearest > _MAX_COVERED_DISTANCE) | (turns > _TOLD_JOINT_TURN)
        covered = (nearest <= _MAX_COVERED_DISTANCE) & ~gesture
        covered &= np.abs(_yaw_rates(frames, headings, end - start) - yaw_rate) < _MAX_YAW_RATE_DIFFERENCE / clip.fps
        moving = speeds[inside].mean() >= _MIN_SPEED_RATIO * speeds.mean()
        complete = covered.mean() >= _MIN_COVERED_FRACTION
        complete &= np.mean((nearest > _MAX_UNLIKE_DISTANCE) | gesture) <= _MAX_UNLIKE_FRACTION
        if not (gap < max_gap and moving and complete):
            return None
        since = float(frames[np.argmax(unlike)]) / clip.fps if unlike.any() else 0.0
        return Cycle(start, end, gap, LeftOut(float(unlike.mean() * clip.duration), since))

    touching = contacts(clip)
    feet_agree = foot_gaps(clip, touching.planted, frames) < MAX_FOOT_GAP
    if lap.clip.n_frames < clip.n_frames:
        start, end = round(lap.start * clip.fps), round(lap.end * clip.fps)
        cycle = repeated(start, end, lap.gap, _MAX_GAIT_GAP)
        if cycle is not None and feet_agree[start // frame_step, end // frame_step]:
            return cycle
    apart = frames[None, :] - frames[:, None] >= max(_MIN_CYCLE_TIME * clip.fps, _MIN_CYCLE_FRACTION * clip.n_frames)
    # Contact forces correct what a cross-fade mixes; a flight across the seam has none.
    supported = touching.supported[frames]
    on_floor = apart & supported[:, None] & supported
    apart = on_floor if on_floor.any() else apart
    for pairs in (apart, apart & feet_agree):
        if not pairs.any():
            return None
        i, j = np.unravel_index(int(np.argmin(np.where(pairs, distances, np.inf))), pairs.shape)
        cycle = repeated(int(frames[i]), int(frames[j]), float(distances[i, j]), _MAX_IN_PLACE_GAP)
        if cycle is None or feet_agree[i, j]:
            return cycle
    return None


def half_stride_instead(clip: Clip, cycle: Cycle) -> HalfStride | None:
    """The half stride that the cycle of a gait is, if the clip is too short for a stride.

    It takes about as long as the cycle, but its end is more like its mirrored start. A start that is like its own
    mirror image, as in jumps, shows nothing.
    """
    if np.linalg.norm(clip.poses[cycle.last, :2] - clip.poses[cycle.first, :2]) < MIN_LAP_TRAVEL:
        return None
    half = find_half_stride(clip)
    if half is None or half.gap >= min(cycle.gap, half.asymmetry):
        return None
    ratio = (cycle.last - cycle.first) / (half.last - half.first)
    return half if 1.0 / _MAX_DURATION_RATIO < ratio < _MAX_DURATION_RATIO else None


def find_half_stride(clip: Clip) -> HalfStride | None:
    """The part whose end is most like its mirrored start; None if there is none."""
    frame_step = -(-2 * clip.n_frames // _COMPARED_FRAMES)
    frames = np.arange(0, clip.n_frames, frame_step)
    both = Clip(np.vstack((clip.poses, mirrored(clip).poses)), clip.fps, clip.name)
    # Frames at the junction of both halves have no valid velocity.
    inner = frames[(frames > 0) & (frames < clip.n_frames - 1)]
    long_enough = inner[:, None] - inner[None, :] >= _MIN_HALF_STRIDE_TIME * clip.fps
    if not long_enough.any():
        return None
    distances, headings = frame_distances(both, np.concatenate((inner, clip.n_frames + inner)))
    direct, crossed = distances[: len(inner), : len(inner)], distances[: len(inner), len(inner) :]
    # Rows are ends, columns mirrored starts.
    j, i = np.unravel_index(int(np.argmin(np.where(long_enough, crossed, np.inf))), crossed.shape)
    width = int(inner[j] - inner[i])
    covered = np.minimum(direct, crossed)[:, i : j + 1].min(axis=1) < _MAX_COVERED_DISTANCE
    covered &= np.abs(_yaw_rates(inner, headings[: len(inner)], 2 * width)) < _MAX_YAW_RATE_DIFFERENCE / clip.fps
    fits = crossed[j, i] < _MAX_MIRRORED_GAP and covered.mean() >= _MIN_COVERED_FRACTION
    return HalfStride(int(inner[i]), int(inner[j]), float(crossed[j, i]), float(crossed[i, i])) if fits else None


def _least_joint_turns(poses: Array, inside: Mask) -> Array:
    """For each pose (n, 75) the least, over poses `inside`, of the largest rotation of a joint between both [rad]."""
    joints = poses[:, 7:].reshape(len(poses), -1, 4)
    cosines = np.ones((len(poses), int(inside.sum())))
    for joint in np.moveaxis(joints, 1, 0):
        np.minimum(cosines, np.abs(joint @ joint[inside].T), out=cosines)
    return np.asarray(2.0 * np.arccos(np.minimum(cosines.max(axis=1), 1.0)))


def _yaw_rates(frames: IntArray, headings: Array, width: int) -> Array:
    """Mean yaw rate over `width` frames around each frame, at the ends over the first or last ones [rad/frame].

    Beyond the first and the last frame the heading counts as constant.
    """
    first = np.clip(frames - width / 2, 0, max(frames[-1] - width, 0))
    return (np.interp(first + width, frames, headings) - np.interp(first, frames, headings)) / width
