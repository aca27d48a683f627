r"""Looping of captures: as a cycle, with a way back, or open and at rest at both ends.

The distance d of two frames is that of `laps`. A part of the clip is its cycle if its ends are similar and the rest of
the clip only repeats it, its turns included; a cross-fade with the frames around its ends makes poses and velocities
agree at the seam. A gesture, whose root ends about where it began, gets a way back to its first pose. Half a stride of
a gait, whose end is the mirror image of its start, is continued by its mirror image. Everything else comes to rest at
both ends, where a walking body stands still on its supporting foot and puts the other one beside it. A closed motion
with a foot that always stands returns exactly to its place: otherwise the foot would skate by the difference in every
lap.
"""

from typing import Literal, NamedTuple

import numpy as np

from geometry import quaternions
from geometry.arrays import Array, IntArray, Mask
from geometry.easing import smooth_steps
from models.errors import ModelError
from models.humanoid.skeleton import BODIES
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip, PlanarDisplacement, pose_difference
from models.mocap.preparation.coming_to_rest import REST_TIME, Ending, come_to_rest, departing
from models.mocap.preparation.laps import best_lap, frame_distances
from models.mocap.preparation.poses import add_tangents, smoothed
from models.mocap.preparation.stances import stances

# Largest d between the ends of a gait cycle, and of a cycle in place [rad]; walks have 0.1 to 0.3. Half the first loops
# two of 17 captures differently, twice the first loops one; half the second changes none, twice the second takes a
# backflip and two kicks for cycles.
_MAX_GAIT_GAP, _MAX_IN_PLACE_GAP = 0.38, 0.30
# Largest d between the ends of a clip whose file declares it cyclic [rad]. Of 17 captures, half the value loops a run
# differently, twice closes a backflip and a kick.
_MAX_DECLARED_GAP = 0.45
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
_MIN_STATED_TIME = 0.2  # least duration of a cycle that is stated [s]
_MIN_HALF_STRIDE_TIME = 0.25  # least duration of half a stride [s]: sprinters take 0.22
# Speed of the root at both ends above which it cannot be brought to rest quickly [m/s]; none of 19 captures is near it.
_FAST_ROOT_SPEED = 1.0
_MIN_CYCLE_TIME = 0.6  # least duration of a cycle in place [s]: half or twice loops all of 19 captures the same way
# Least duration of a cycle in place as a fraction of the clip's: shorter ones are tremor. Half loops all of 19 captures
# the same way, twice one of them differently.
_MIN_CYCLE_FRACTION = 0.3
# Half width of the cross-fade at the ends [s]: half or twice changes joints of 19 captures by 0.3 or 0.1° RMS.
_FADE_TIME = 0.25
# Duration of a way back [s], and the addition for each radian of the largest joint rotation [s/rad].
_WAY_BACK_TIMES = (0.6, 1.0)
# A gesture's root ends within this distance [m] and angle [rad] of where it began. Half the distance leaves one of 19
# captures open, twice changes none.
_IN_PLACE_DISTANCE, _IN_PLACE_ANGLE = 0.10, np.deg2rad(15.0)
# Approximate number of frames that are compared with each other: a matrix takes 2 MB. Half or twice loops 17 captures
# the same way.
_COMPARED_FRAMES = 500

Kind = Literal["cycle", "half stride", "way back", "open"]


class LeftOut(NamedTuple):
    """Time for which a capture is unlike all of its cycle, and when it first is [s]."""

    seconds: float
    since: float


class LoopedClip(NamedTuple):
    """A looped clip.

    Attributes
    ----------
    clip : Clip
        Closed, or at rest at both ends.
    kind : {"cycle", "half stride", "way back", "open"}
        How it was looped.
    start, end : float
        The part of the capture that was used [s]; `start` is negative for an open clip, which begins at rest before it.
    gap : float
        d between its ends before closing [rad].
    turns : tuple of float
        Change of heading in the capture, and what it would be at the loop's yaw rate [rad]; equal if it is the
        whole clip, and zeros if it is open, has a way back or was closed already.
    left_out : LeftOut
        What the capture has and its cycle has not.
    """

    clip: Clip
    kind: Kind
    start: float
    end: float
    gap: float
    turns: tuple[float, float] = (0.0, 0.0)
    left_out: LeftOut = LeftOut(0.0, 0.0)


def close_or_rest(
    clip: Clip, wish: str = "auto", wraps: bool | None = None, mirror: bool = False, ending: Ending = "step"
) -> LoopedClip:
    """Close a clip, or bring it to rest at both ends.

    Parameters
    ----------
    clip : Clip
        A capture.
    wish : str
        ``auto``, ``open``, ``lap`` (the part that repeats itself best, however well it does), or the start and end of
        the cycle in seconds, such as ``1.2:2.4``.
    wraps : bool or None
        Whether the file declares itself to be cyclic; None if it says nothing.
    mirror : bool
        Whether half a stride, or START:END, is to be continued by its mirror image.
    ending : {"step", "decay", "limited decay"}
        How an open clip comes to rest: with a last step where it walks, by decay of its velocities, or with joints that
        would leave their ranges stopped in less time.

    Raises
    ------
    ModelError
        If `wish` is none of these or not within the clip, or if the clip has no half stride.
    """
    whole = (0, clip.n_frames - 1)
    if mirror:
        half = _find_half_stride(clip) if wish == "auto" else (*_requested_frames(clip, wish), np.nan)
        if half is None:
            raise ModelError(f"{clip.name}: --mirror, but no part of it ends like its start mirrored; expected a gait")
        return _close(clip, *half, half=True)
    if clip.n_frames < 8 or wish == "open":
        return _bring_to_rest(clip, ending)
    if wish == "lap":
        lap = best_lap(clip)
        return _close(clip, round(lap.start * clip.fps), round(lap.end * clip.fps), lap.gap)
    if wish != "auto":
        start, end = _requested_frames(clip, wish)
        return _close(clip, start, end, float(_distances(clip, np.array([start, end]))[0, 1]))
    if clip.closes():
        return LoopedClip(clip, "cycle", 0.0, clip.duration, 0.0)
    if clip.closes(CLOSURE_TOLERANCE):
        return _close(clip, *whole, 0.0)
    gap = float(_distances(clip, np.array(whole))[0, 1])
    if wraps and gap < _MAX_DECLARED_GAP:
        return _close(clip, *whole, gap)
    if (cycle := _find_cycle(clip)) is not None:
        return _close(clip, cycle.first, cycle.last, cycle.gap)._replace(left_out=cycle.left_out)
    if _is_in_place(clip):
        return _with_return(clip, gap)
    if _is_fast(clip) and (half := _find_half_stride(clip)) is not None:
        return _close(clip, *half, half=True)
    return _bring_to_rest(clip, ending)


def _requested_frames(clip: Clip, wish: str) -> tuple[int, int]:
    try:
        start, end = (float(part) for part in wish.split(":"))
    except ValueError:
        raise ModelError(f"--loop {wish!r}; expected auto, open, lap, or START:END in seconds") from None
    half_frame = 0.5 / clip.fps
    if not (0.0 <= start <= end - _MIN_STATED_TIME + half_frame and end <= clip.duration + half_frame):
        raise ModelError(
            f"--loop {wish}; expected 0 ≤ START, END {_MIN_STATED_TIME} s later or more, and at {clip.duration:.2f} s "
            "at most, both from the first frame that is kept"
        )
    return round(start * clip.fps), min(round(end * clip.fps), clip.n_frames - 1)


def _distances(clip: Clip, frames: IntArray) -> Array:
    return frame_distances(clip, frames)[0]


class _Cycle(NamedTuple):
    """First and last frame of the part that a clip repeats, d between them, and `left_out`."""

    first: int
    last: int
    gap: float
    left_out: LeftOut


def _find_cycle(clip: Clip) -> _Cycle | None:
    """The part that the clip repeats: a gait cycle, or else a cycle in place."""
    frame_step = -(-clip.n_frames // _COMPARED_FRAMES)
    frames = np.arange(0, clip.n_frames, frame_step)
    distances, headings = frame_distances(clip, frames)
    lap = best_lap(clip)
    speeds = np.sqrt(np.mean(clip.velocities()[frames, 6:] ** 2, axis=1))
    candidates: list[tuple[int, int, float, float]] = []
    if lap.clip.n_frames < clip.n_frames:
        candidates.append((round(lap.start * clip.fps), round(lap.end * clip.fps), lap.gap, _MAX_GAIT_GAP))
    shortest = max(_MIN_CYCLE_TIME * clip.fps, _MIN_CYCLE_FRACTION * clip.n_frames)
    candidates_apart = np.where(frames[None, :] - frames[:, None] >= shortest, distances, np.inf)
    if np.isfinite(candidates_apart).any():
        i, j = np.unravel_index(int(np.argmin(candidates_apart)), candidates_apart.shape)
        candidates.append((int(frames[i]), int(frames[j]), float(candidates_apart[i, j]), _MAX_IN_PLACE_GAP))
    for start, end, gap, max_gap in candidates:
        inside = (frames >= start) & (frames <= end)
        if inside.sum() < 2:
            continue  # shorter than two steps of the comparison
        yaw_rate = np.diff(headings[inside][[0, -1]]) / (frames[inside][-1] - frames[inside][0])
        nearest = distances[:, inside].min(axis=1)
        turns = _least_joint_turns(clip.poses[frames], inside)
        gesture, unlike = turns > _MAX_JOINT_TURN, (nearest > _MAX_COVERED_DISTANCE) | (turns > _TOLD_JOINT_TURN)
        covered = (nearest <= _MAX_COVERED_DISTANCE) & ~gesture
        covered &= np.abs(_yaw_rates(frames, headings, end - start) - yaw_rate) < _MAX_YAW_RATE_DIFFERENCE / clip.fps
        moving = speeds[inside].mean() >= _MIN_SPEED_RATIO * speeds.mean()
        complete = covered.mean() >= _MIN_COVERED_FRACTION
        complete &= np.mean((nearest > _MAX_UNLIKE_DISTANCE) | gesture) <= _MAX_UNLIKE_FRACTION
        if gap < max_gap and moving and complete:
            since = float(frames[np.argmax(unlike)]) / clip.fps if unlike.any() else 0.0
            return _Cycle(start, end, gap, LeftOut(float(unlike.mean() * clip.duration), since))
    return None


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


def _is_fast(clip: Clip) -> bool:
    """Whether the root moves faster than `_FAST_ROOT_SPEED` at both ends."""
    speeds = np.linalg.norm(clip.velocities()[[0, -1], :2], axis=1)
    return bool(speeds.min() > _FAST_ROOT_SPEED)


def _is_in_place(clip: Clip) -> bool:
    """Whether the root ends about where it began, with about the same heading."""
    travel = clip.poses[-1, :2] - clip.poses[0, :2]
    return bool(np.hypot(*travel) < _IN_PLACE_DISTANCE and abs(clip.displacement.yaw) < _IN_PLACE_ANGLE)


def _close(clip: Clip, first: int, last: int, gap: float, half: bool = False) -> LoopedClip:
    """The frames from first to last as a closed lap, cross-faded with the frames before the first and after the last.

    With `half`, the part ends like the mirror image of its start, and is continued by its own mirror image.
    """
    image = mirrored if half else _identity
    opening, n = image(clip).poses, last - first
    poses = clip.poses
    displacement = Clip(np.vstack((opening[first], poses[last])), clip.fps, clip.name).displacement
    inverse = displacement.inverse()
    width = int(min(_FADE_TIME * clip.fps, n // 3))
    before, after = min(width, first), min(width, clip.n_frames - 1 - last)
    lap = poses[first : last + 1].copy()
    if before + after >= 6:
        for k in range(-before, after + 1):
            # 0 is the motion at the lap's end, 1 that at its start (or its mirror image), both at the same place.
            fade = smooth_steps(np.array((k + before) / (before + after)))
            end = inverse.moved(poses[last + k])
            mixed = add_tangents(end[None], fade * pose_difference(end, opening[first + k])[None])
            if k >= 0:
                lap[k] = image(Clip(mixed, clip.fps, clip.name)).poses[0]
            if k <= 0:
                lap[n + k] = displacement.moved(mixed[0])
    rest = pose_difference(displacement.moved(image(Clip(lap[:1], clip.fps, clip.name)).poses[0]), lap[-1])
    lap = add_tangents(lap, -np.linspace(0.0, 1.0, n + 1)[:, None] * rest)
    if half:
        other = image(Clip(lap, clip.fps, clip.name))
        join = Clip(np.vstack((other.poses[0], lap[-1])), clip.fps, clip.name).displacement
        lap = np.vstack((lap, join.moved(other.poses)[1:]))
    lap[-1] = Clip(lap, clip.fps, clip.name).displacement.moved(lap[0])
    result = Clip(lap, clip.fps, clip.name)
    if _is_in_place(result) and _has_standing_foot(result):
        result = _without_displacement(result)
    headings = np.unwrap(quaternions.heading(clip.poses[:, 3:7]))
    turn, own_turn = headings[-1] - headings[0], 0.0 if half else headings[last] - headings[first]
    turns = float(turn), float(own_turn * (clip.n_frames - 1) / n)
    return LoopedClip(result, "half stride" if half else "cycle", first / clip.fps, last / clip.fps, gap, turns)


def _has_standing_foot(clip: Clip) -> bool:
    """Whether one foot stands in every frame."""
    standing = stances(clip, clip).feet.reshape(clip.n_frames, 2, -1)
    return bool(standing.any(axis=2).all(axis=0).any())


def _without_displacement(clip: Clip) -> Clip:
    """The lap without its net displacement, which is removed linearly over the lap."""
    displacement, start = clip.displacement, clip.poses[0, :2]
    travel = clip.poses[-1, :2] - start
    poses = clip.poses.copy()
    for k, fraction in enumerate(np.linspace(0.0, 1.0, clip.n_frames)):
        turned = PlanarDisplacement(0.0, 0.0, -fraction * displacement.yaw)
        moved = clip.poses[k].copy()
        moved[:2] -= start + fraction * travel
        poses[k] = turned.moved(moved)
        poses[k, :2] += start
    poses[-1] = poses[0]
    return Clip(poses, clip.fps, clip.name)


def _identity(clip: Clip) -> Clip:
    return clip


def _find_half_stride(clip: Clip) -> tuple[int, int, float] | None:
    """First frame, last frame and gap of the part whose end is most like its mirrored start; None if there is none."""
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
    return (int(inner[i]), int(inner[j]), float(crossed[j, i])) if fits else None


def _with_return(clip: Clip, gap: float) -> LoopedClip:
    """The clip and a way back from its last frame to its first: a quintic in the tangent, with matching velocities."""
    first, last = clip.poses[0] if _has_standing_foot(clip) else clip.displacement.moved(clip.poses[0]), clip.poses[-1]
    difference = pose_difference(last, first)
    largest = float(np.linalg.norm(difference[6:].reshape(-1, 3), axis=1).max())
    n = round((_WAY_BACK_TIMES[0] + _WAY_BACK_TIMES[1] * largest) * clip.fps)
    speeds = _low_passed_velocities(clip) / clip.fps * n
    start, end = speeds[-1], speeds[0]
    x = np.linspace(0.0, 1.0, n + 1)[1:, None]
    # Quintic with the ends' values and velocities and no acceleration.
    ease = smooth_steps(x)
    arrive = -4.0 * x**3 + 7.0 * x**4 - 3.0 * x**5
    way = add_tangents(np.repeat(last[None], n, axis=0), ease * difference + departing(x) * start + arrive * end)
    way[-1] = first
    return LoopedClip(Clip(np.vstack((clip.poses, way)), clip.fps, clip.name), "way back", 0.0, clip.duration, gap)


def _bring_to_rest(clip: Clip, ending: Ending) -> LoopedClip:
    """The clip with frames added at both ends, in which the body comes to rest with its soles on the floor."""
    if clip.n_frames < 2 or clip.fps * REST_TIME < 2.0:
        return LoopedClip(clip, "open", 0.0, clip.duration, 0.0)
    velocities = _low_passed_velocities(clip)
    before = come_to_rest(clip.poses[0], -velocities[0], clip.fps, ending)[::-1]
    after = come_to_rest(clip.poses[-1], velocities[-1], clip.fps, ending)
    poses = np.vstack((before, clip.poses, after))
    start = -len(before) / clip.fps
    return LoopedClip(Clip(poses, clip.fps, clip.name), "open", start, clip.duration, 0.0)


def _low_passed_velocities(clip: Clip) -> Array:
    """Velocities of the low-passed clip, shape (n, 57): at 120 Hz, 8° of noise in a first frame would be 17 rad/s."""
    return smoothed(clip).velocities()


def mirrored(clip: Clip) -> Clip:
    """The mirror image of a motion: left and right exchanged."""
    twins = [
        BODIES.index(body.replace("left_", "right_") if body.startswith("left_") else body.replace("right_", "left_"))
        for body in BODIES
    ]
    poses = clip.poses.copy()
    poses[:, 1] *= -1.0
    rotations = poses[:, 3:].reshape(clip.n_frames, -1, 4)[:, twins] * np.array([1.0, -1.0, 1.0, -1.0])
    poses[:, 3:] = rotations.reshape(clip.n_frames, -1)
    return Clip(poses, clip.fps, clip.name)
