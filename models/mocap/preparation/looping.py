r"""Looping of captures: as a cycle, with a way back, or open and at rest at both ends.

The similarity d of two frames is that of `laps`. A part of the clip is its cycle if its ends are similar and the rest
of the clip only repeats it; a cross-fade with the frames around its ends makes poses and velocities agree at the seam.
A gesture, whose root ends about where it began, gets a way back to its first pose. Half a stride of a gait, whose end
is the mirror image of its start, is continued by its mirror image. Everything else comes to rest at both ends. A closed
motion with a foot that always stands returns exactly to its place: otherwise the foot would skate by the difference in
every lap.
"""

from typing import Literal, NamedTuple

import numpy as np

from models.arrays import Array, IntArray
from models.errors import ModelError
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS
from models.mocap.motion.clip import CLOSES, Clip, PlanarDisplacement, pose_difference
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.preparation.laps import lap_of, likeness
from models.mocap.preparation.poses import plus, smoothed, sole_points
from models.mocap.preparation.stances import stances

# Largest d of the ends of a gait cycle, of a cycle in place [rad]; walks have 0.1 to 0.3. Of 17 captures half of the
# first loops two otherwise, twice one; half of the second none, twice takes a backflip and two kicks for cycles.
_GAIT, _PLACE = 0.38, 0.30
# Largest d of a clip that its file declares to be cyclic [rad]: of 17 captures half loops a run otherwise, twice closes
# a backflip and a kick.
_WRAPS = 0.45
# Share of the clip's frames that must have a frame of the cycle within this d [rad]. A share of 0.5 loops all of 19
# captures alike, 0.9 one otherwise; half of d leaves CMU 01_01 open, twice takes a dance for a cycle.
_COVERS, _NEAR = 0.7, 0.35
_LIVELY = 0.7  # least mean speed of a cycle over the clip's: standing still is none; half of it loops 19 captures alike
# Largest d of the mirrored ends of half a stride [rad]: a run has 0.18, a third of a stride 0.3. Twice changes none of
# 17 captures, half leaves a run open.
_MIRRORED = 0.25
_HALF = 0.25  # least duration of half a stride [s]: sprinters take 0.22
# Speed of the root at both ends above which it cannot be brought to rest quickly [m/s]; of 19 captures none is near.
_FAST = 1.0
_SHORTEST = 0.6  # least duration of a cycle in place [s]: half or twice loops all of 19 captures alike
# Least duration of a cycle in place as a share of the clip: shorter ones are tremor. Half loops all of 19 captures
# alike, twice one otherwise.
_SHARE = 0.3
# Half width of the cross-fade at the ends [s]: half or twice moves joints of 19 captures by 0.3 or 0.1° RMS.
_FADE = 0.25
_BACK = (0.6, 1.0)  # duration of a way back [s], and what each radian of the largest joint rotation adds [s/rad]
# A gesture's root ends within this of where it began [m], [rad]. Half of the first leaves one of 19 captures open,
# twice changes none.
_STEP, _YAW = 0.10, np.deg2rad(15.0)
# Time in which limbs come to rest at an end [s]: in a longer one they pass their joint limits. The root has more for
# each m/s of its speed [s per m/s], up to the last number [s].
_REST = 0.35
_REST_LONGER, _REST_LONGEST = 0.2, 0.8
# How far a joint may leave its range as it comes to rest [rad], and how often its time is halved, down to 0.01 s.
_SLACK, _HALVINGS = np.deg2rad(1.0), 6
_FRAMES = 500  # frames compared with each other, about: a matrix takes 2 MB; half or twice loops 17 captures alike

Kind = Literal["cycle", "half stride", "way back", "open"]


class Looped(NamedTuple):
    """A looped clip.

    Attributes
    ----------
    clip : Clip
        Closed, or at rest at both ends.
    kind : {"cycle", "half stride", "way back", "open"}
        How it was looped.
    start, end : float
        The part of the capture that was used [s]; an open clip, which comes from rest, begins before it.
    gap : float
        d between its ends before closing [rad].
    """

    clip: Clip
    kind: Kind
    start: float
    end: float
    gap: float


def looped(
    clip: Clip, wish: str = "auto", wraps: bool | None = None, mirror: bool = False, within: bool = False
) -> Looped:
    """Close a clip, or bring it to rest at both ends.

    Parameters
    ----------
    clip : Clip
        A capture.
    wish : str
        ``auto``, ``open``, or the start and end of the cycle in seconds, such as ``1.2:2.4``.
    wraps : bool or None
        Whether the file declares itself to be cyclic; None if it says nothing.
    mirror : bool
        Whether half a stride, or START:END, is to be continued by its mirror image.
    within : bool
        Whether joints of an open clip that would leave their ranges as they come to rest do so in less time.

    Raises
    ------
    ModelError
        If the wish is none of these, or not within the clip, or no half stride is in it.
    """
    whole = (0, clip.n_frames - 1)
    if mirror:
        half = _half_stride(clip) if wish == "auto" else (*_wished(clip, wish), np.nan)
        if half is None:
            raise ModelError(
                f"{clip.name}: --mirror, but no part of it ends like its start in a mirror; expected a gait"
            )
        return _closed(clip, *half, half=True)
    if clip.n_frames < 8 or wish == "open":
        return _rested(clip, within)
    if wish != "auto":
        start, end = _wished(clip, wish)
        return _closed(clip, start, end, float(_distances(clip, np.array([start, end]))[0, 1]))
    if clip.closes():
        return Looped(clip, "cycle", 0.0, clip.duration, 0.0)
    if clip.closes(CLOSES):
        return _closed(clip, *whole, 0.0)
    gap = float(_distances(clip, np.array(whole))[0, 1])
    if wraps and gap < _WRAPS:
        return _closed(clip, *whole, gap)
    if (cycle := _cycle(clip)) is not None:
        return _closed(clip, *cycle)
    if _in_place(clip):
        return _with_way_back(clip, gap)
    if _fast(clip) and (half := _half_stride(clip)) is not None:
        return _closed(clip, *half, half=True)
    return _rested(clip, within)


def _wished(clip: Clip, wish: str) -> tuple[int, int]:
    try:
        start, end = (float(part) for part in wish.split(":"))
    except ValueError:
        raise ModelError(f"--loop {wish!r}; expected auto, open, or START:END in seconds") from None
    if not 0.0 <= start < end - 0.2 <= clip.duration:
        raise ModelError(
            f"--loop {wish}; expected 0 ≤ START, END 0.2 s later or more, and at {clip.duration:.2f} s at most, "
            "both from the first frame that is kept"
        )
    return round(start * clip.fps), min(round(end * clip.fps), clip.n_frames - 1)


def _distances(clip: Clip, frames: IntArray) -> Array:
    return likeness(clip, frames)[0]


def _cycle(clip: Clip) -> tuple[int, int, float] | None:
    """First frame, last frame and gap of the part that the clip repeats: a gait cycle, or else a cycle in place."""
    every = -(-clip.n_frames // _FRAMES)
    frames = np.arange(0, clip.n_frames, every)
    apart = _distances(clip, frames)
    lap = lap_of(clip)
    speeds = np.sqrt(np.mean(clip.velocities()[frames, 6:] ** 2, axis=1))
    candidates: list[tuple[int, int, float, float]] = []
    if lap.clip.n_frames < clip.n_frames:
        candidates.append((round(lap.start * clip.fps), round(lap.end * clip.fps), lap.gap, _GAIT))
    least = max(_SHORTEST * clip.fps, _SHARE * clip.n_frames)
    long = np.where(frames[None, :] - frames[:, None] >= least, apart, np.inf)
    if np.isfinite(long).any():
        i, j = np.unravel_index(int(np.argmin(long)), long.shape)
        candidates.append((int(frames[i]), int(frames[j]), float(long[i, j]), _PLACE))
    for start, end, gap, alike in candidates:
        inside = (frames >= start) & (frames <= end)
        covered = apart[:, inside].min(axis=1) < _NEAR
        lively = speeds[inside].mean() >= _LIVELY * speeds.mean()
        if gap < alike and lively and covered.mean() >= _COVERS:
            return start, end, gap
    return None


def _fast(clip: Clip) -> bool:
    """Whether the root moves faster than `_FAST` at both ends."""
    speeds = np.linalg.norm(clip.velocities()[[0, -1], :2], axis=1)
    return bool(speeds.min() > _FAST)


def _in_place(clip: Clip) -> bool:
    """Whether the root ends about where it began, with about the same heading."""
    way = clip.poses[-1, :2] - clip.poses[0, :2]
    return bool(np.hypot(*way) < _STEP and abs(clip.displacement.yaw) < _YAW)


def _closed(clip: Clip, first: int, last: int, gap: float, half: bool = False) -> Looped:
    """The frames from first to last as a closed lap, cross-faded with the frames before the first and after the last.

    With `half`, the part ends like the mirror image of its start, and is continued by its own mirror image.
    """
    image = mirrored if half else _same
    opening, n = image(clip).poses, last - first
    poses = clip.poses
    there = Clip(np.vstack((opening[first], poses[last])), clip.fps, clip.name).displacement
    back = there.inverse()
    width = int(min(_FADE * clip.fps, n // 3))
    before, after = min(width, first), min(width, clip.n_frames - 1 - last)
    lap = poses[first : last + 1].copy()
    if before + after >= 6:
        for k in range(-before, after + 1):
            # Share 0 is the motion at the lap's end, 1 that at its start (or its mirror image), both at the same place.
            share = _smooth((k + before) / (before + after))
            end = back.moved(poses[last + k])
            mixed = plus(end[None], share * pose_difference(end, opening[first + k])[None])
            if k >= 0:
                lap[k] = image(Clip(mixed, clip.fps, clip.name)).poses[0]
            if k <= 0:
                lap[n + k] = there.moved(mixed[0])
    rest = pose_difference(there.moved(image(Clip(lap[:1], clip.fps, clip.name)).poses[0]), lap[-1])
    lap = plus(lap, -np.linspace(0.0, 1.0, n + 1)[:, None] * rest)
    if half:
        other = image(Clip(lap, clip.fps, clip.name))
        join = Clip(np.vstack((other.poses[0], lap[-1])), clip.fps, clip.name).displacement
        lap = np.vstack((lap, join.moved(other.poses)[1:]))
    lap[-1] = Clip(lap, clip.fps, clip.name).displacement.moved(lap[0])
    made = Clip(lap, clip.fps, clip.name)
    if _in_place(made) and _stands(made):
        made = _brought_back(made)
    return Looped(made, "half stride" if half else "cycle", first / clip.fps, last / clip.fps, gap)


def _stands(clip: Clip) -> bool:
    """Whether one foot stands in every frame."""
    standing = stances(clip, clip).feet.reshape(clip.n_frames, 2, -1)
    return bool(standing.any(axis=2).all(axis=0).any())


def _brought_back(clip: Clip) -> Clip:
    """The lap without its net displacement, which is removed linearly over the lap."""
    there, start = clip.displacement, clip.poses[0, :2]
    way = clip.poses[-1, :2] - start
    poses = clip.poses.copy()
    for k, share in enumerate(np.linspace(0.0, 1.0, clip.n_frames)):
        turned = PlanarDisplacement(0.0, 0.0, -share * there.yaw)
        moved = clip.poses[k].copy()
        moved[:2] -= start + share * way
        poses[k] = turned.moved(moved)
        poses[k, :2] += start
    poses[-1] = poses[0]
    return Clip(poses, clip.fps, clip.name)


def _same(clip: Clip) -> Clip:
    return clip


def _half_stride(clip: Clip) -> tuple[int, int, float] | None:
    """First frame, last frame and gap of the part whose end is most like its mirrored start; None if none is."""
    every = -(-2 * clip.n_frames // _FRAMES)
    frames = np.arange(0, clip.n_frames, every)
    both = Clip(np.vstack((clip.poses, mirrored(clip).poses)), clip.fps, clip.name)
    # Frames at the junction of both halves have no valid velocity.
    inner = frames[(frames > 0) & (frames < clip.n_frames - 1)]
    apart = _distances(both, np.concatenate((inner, clip.n_frames + inner)))[: len(inner), len(inner) :]
    long = inner[:, None] - inner[None, :] >= _HALF * clip.fps
    if not long.any():
        return None
    # Rows are ends, columns mirrored starts.
    j, i = np.unravel_index(int(np.argmin(np.where(long, apart, np.inf))), apart.shape)
    return (int(inner[i]), int(inner[j]), float(apart[j, i])) if apart[j, i] < _MIRRORED else None


def _smooth(x: float | Array) -> Array:
    """S(x) = x³ (10 − 15 x + 6 x²) on [0, 1], 0 before and 1 after; C²."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def _with_way_back(clip: Clip, gap: float) -> Looped:
    """The clip and a way back from its last frame to its first: a quintic in the tangent, with matching velocities."""
    first, last = clip.poses[0] if _stands(clip) else clip.displacement.moved(clip.poses[0]), clip.poses[-1]
    difference = pose_difference(last, first)
    largest = float(np.linalg.norm(difference[6:].reshape(-1, 3), axis=1).max())
    n = round((_BACK[0] + _BACK[1] * largest) * clip.fps)
    speeds = _calm_velocities(clip) / clip.fps * n
    start, end = speeds[-1], speeds[0]
    x = np.linspace(0.0, 1.0, n + 1)[1:, None]
    # Quintic with the ends' values and velocities and no acceleration.
    ease = _smooth(x)
    leave = x - 6.0 * x**3 + 8.0 * x**4 - 3.0 * x**5
    arrive = -4.0 * x**3 + 7.0 * x**4 - 3.0 * x**5
    way = plus(np.repeat(last[None], n, axis=0), ease * difference + leave * start + arrive * end)
    way[-1] = first
    return Looped(Clip(np.vstack((clip.poses, way)), clip.fps, clip.name), "way back", 0.0, clip.duration, gap)


def _rested(clip: Clip, within: bool) -> Looped:
    """The clip with frames added at both ends in which its velocities decay to rest, with the soles on the floor."""
    if clip.n_frames < 2 or clip.fps * _REST < 2.0:
        return Looped(clip, "open", 0.0, clip.duration, 0.0)
    velocities = _calm_velocities(clip)
    before = _dying(clip.poses[0], -velocities[0], clip.fps, within)[::-1]
    after = _dying(clip.poses[-1], velocities[-1], clip.fps, within)
    poses = np.vstack((before, clip.poses, after))
    start = -len(before) / clip.fps
    return Looped(Clip(poses, clip.fps, clip.name), "open", start, clip.duration, 0.0)


def _calm_velocities(clip: Clip) -> Array:
    """Velocities of the low-passed clip (n, 57): at 120 Hz, 8° of noise in its first frame are 17 rad/s there."""
    return smoothed(clip).velocities()


def _dying(pose: Array, velocity: Array, fps: float, within: bool) -> Array:
    """Poses in which a velocity decays as (1 − x)² (1 + 2x), x = t/T, while the soles come down to the floor.

    T grows with the root's speed for the root only: with a longer T limbs would pass their joint limits. With `within`,
    a joint that would leave its range nevertheless, as by the noise of a first frame, has half of T, or a quarter, ….
    """
    longest = np.minimum(_REST + _REST_LONGER * float(np.linalg.norm(velocity[:2])), _REST_LONGEST)
    times = np.repeat((longest, _REST), (3, len(velocity) - 3))
    allowed = np.maximum(beyond_ranges(pose[None])[0], 0.0) + _SLACK
    for _ in range(_HALVINGS if within else 0):
        times[6:] /= 1.0 + np.repeat(beyond_ranges(_decay(pose, velocity, times, fps)).max(axis=0) > allowed, 3)
    poses = _decay(pose, velocity, times, fps)
    x = np.arange(1, len(poses) + 1) / (fps * longest)
    low = sole_points(poses)[:, :, 2].min(axis=1) - CONTACT_RADIUS
    poses[:, 2] -= _smooth(x) * low
    return poses


def _decay(pose: Array, velocity: Array, times: Array, fps: float) -> Array:
    """Poses over the longest of the times T (57,) in which each component of a velocity decays in its own [s]."""
    x = np.minimum(np.arange(1, round(times.max() * fps) + 1)[:, None] / (fps * times), 1.0)
    return plus(np.repeat(pose[None], len(x), axis=0), (x - x**3 + x**4 / 2.0) * times * velocity)


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
