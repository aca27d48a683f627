r"""How a capture goes on: as a cycle, with a way back, or not at all; closed in pose and velocity.

Two frames are as alike as `laps` has it. A part of the clip is its cycle if its ends are alike and the rest of the clip
only repeats it; it is closed by fading over from what led to its start, so that poses and velocities agree at the seam.
A gesture, which ends with the feet where they were, gets a way back. Half a stride of a gait, which ends as it began in
a mirror, is gone on with by its mirror image. Everything else rests at both ends. What stands on a foot all the time
comes back to its place: a lap that ended a centimetre beside its start would drag that foot by it for ever.
"""

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from models.arrays import Array
from models.errors import ModelError
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS
from models.mocap.clip import Clip, PlanarDisplacement, pose_difference
from models.mocap.laps import lap_of, likeness
from models.mocap.preparation.poses import inverse, plus, sole_points
from models.mocap.preparation.stances import stances

_GAIT, _PLACE = 0.38, 0.30  # d of the ends of a gait, of a cycle in place [rad]; walkers have 0.1 to 0.3
_DIGITS = 1e-3  # by which the ends of a lap that was written with few digits differ [rad], [m]
_WRAPS = 0.45  # d that is still closed where the file says that it wraps
_COVERS, _NEAR = 0.7, 0.35  # a cycle has a frame within this distance [rad] of so large a share of the clip
_LIVELY = 0.7  # a cycle moves at least so much, on the average, as the clip: standing still is no cycle of it
_MIRRORED = 0.25  # d of the ends of half a stride [rad]: a run has 0.18, a third of a stride 0.3
_HALF = 0.25  # of half a stride, at least [s]: sprinters take 0.22
_FAST = 1.0  # of the root at both ends [m/s]: such a motion cannot be brought to rest in a blink
_SHORTEST = 0.6  # of a cycle in place [s]
_SHARE = 0.3  # of the clip, the least that a cycle in place lasts: less is a tremble
_FADE = 0.25  # over which the ends are brought together [s]
_BACK = (0.6, 1.0)  # a way back lasts so long, and so much longer for each radian of the largest joint [s]
_STEP, _YAW = 0.10, np.deg2rad(15.0)  # feet of a gesture end within this of where they began
_REST = 0.35  # in which the limbs of a motion that ends come to rest [s]; its root has 0.2 s more for each m/s
_REST_LONGER, _REST_LONGEST = 0.2, 0.8
_FRAMES = 500  # compared with each other

Kind = Literal["cycle", "half stride", "way back", "open"]


class Looped(NamedTuple):
    """A clip made to go on, or to rest.

    Attributes
    ----------
    clip : Clip
        Closed, or at rest at both ends.
    kind : {"cycle", "half stride", "way back", "open"}
        What was done.
    start, end : float
        The part of the capture that it is [s].
    gap : float
        d of its ends before they were closed [rad].
    """

    clip: Clip
    kind: Kind
    start: float
    end: float
    gap: float


def looped(clip: Clip, wish: str = "auto", wraps: bool | None = None, mirror: bool = False) -> Looped:
    """Close a clip, or bring it to rest at both ends.

    Parameters
    ----------
    clip : Clip
        A capture.
    wish : str
        ``auto``, ``open``, or the start and end of the cycle in seconds, such as ``1.2:2.4``.
    wraps : bool or None
        What the file says of itself.
    mirror : bool
        Whether half a stride, or START:END, is to be gone on with by its mirror image.

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
        return _rested(clip)
    if wish != "auto":
        start, end = _wished(clip, wish)
        return _closed(clip, start, end, float(_distances(clip, np.array([start, end]))[0, 1]))
    if clip.closes():
        return Looped(clip, "cycle", 0.0, clip.duration, 0.0)
    if clip.closes(_DIGITS):
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
    return _rested(clip)


def _wished(clip: Clip, wish: str) -> tuple[int, int]:
    try:
        start, end = (float(part) for part in wish.split(":"))
    except ValueError:
        raise ModelError(f"--loop {wish!r}; expected auto, open, or START:END in seconds") from None
    if not 0.0 <= start < end - 0.2 <= clip.duration:
        raise ModelError(f"--loop {wish} of a clip of {clip.duration:.2f} s; expected START ≥ 0, 0.2 s before END")
    return round(start * clip.fps), min(round(end * clip.fps), clip.n_frames - 1)


def _distances(clip: Clip, frames: npt.NDArray[np.int64]) -> Array:
    return likeness(clip, frames)[0]


def _cycle(clip: Clip) -> tuple[int, int, float] | None:
    """Start, end and gap of the part that the clip repeats: a lap of a gait, else a cycle in place."""
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
    """Whether the root runs at both ends."""
    speeds = np.linalg.norm(clip.velocities()[[0, -1], :2], axis=1)
    return bool(speeds.min() > _FAST)


def _in_place(clip: Clip) -> bool:
    """Whether the root ends where it began, looking where it did."""
    way = clip.poses[-1, :2] - clip.poses[0, :2]
    return bool(np.hypot(*way) < _STEP and abs(clip.displacement.yaw) < _YAW)


def _closed(clip: Clip, first: int, last: int, gap: float, half: bool = False) -> Looped:
    """The frames from first to last, ends brought together from what leads to the first and follows the last.

    A half stride ends like its start in a mirror, and is followed by its own image there.
    """
    image = mirrored if half else _same
    opening, n = image(clip).poses, last - first
    poses = clip.poses
    there = Clip(np.vstack((opening[first], poses[last])), clip.fps, clip.name).displacement
    back = inverse(there)
    width = int(min(_FADE * clip.fps, n // 3))
    before, after = min(width, first), min(width, clip.n_frames - 1 - last)
    lap = poses[first : last + 1].copy()
    if before + after >= 6:
        for k in range(-before, after + 1):
            # 0: as at the end of the lap, 1: as at its start, both seen from the start's image.
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
    """Whether a foot stands from the first frame to the last."""
    standing = stances(clip, clip).standing.reshape(clip.n_frames, 2, -1)
    return bool(standing.any(axis=2).all(axis=0).any())


def _brought_back(clip: Clip) -> Clip:
    """A lap without the displacement that it has, which is taken from it little by little."""
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
    """Start, end and gap of the part whose end is most like its start in a mirror, if it is like it."""
    every = -(-2 * clip.n_frames // _FRAMES)
    frames = np.arange(0, clip.n_frames, every)
    both = Clip(np.vstack((clip.poses, mirrored(clip).poses)), clip.fps, clip.name)
    # The frame at the joint has no velocity of its own.
    inner = frames[(frames > 0) & (frames < clip.n_frames - 1)]
    apart = _distances(both, np.concatenate((inner, clip.n_frames + inner)))[: len(inner), len(inner) :]
    long = inner[:, None] - inner[None, :] >= _HALF * clip.fps
    if not long.any():
        return None
    # Rows: ends, columns: starts, in the mirror.
    j, i = np.unravel_index(int(np.argmin(np.where(long, apart, np.inf))), apart.shape)
    return (int(inner[i]), int(inner[j]), float(apart[j, i])) if apart[j, i] < _MIRRORED else None


def _smooth(x: float) -> float:
    x = min(max(x, 0.0), 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)


def _with_way_back(clip: Clip, gap: float) -> Looped:
    """The clip and a smooth way from its last frame to its first one, velocities kept (a quintic in the tangent)."""
    first, last = clip.poses[0] if _stands(clip) else clip.displacement.moved(clip.poses[0]), clip.poses[-1]
    difference = pose_difference(last, first)
    largest = float(np.linalg.norm(difference[6:].reshape(-1, 3), axis=1).max())
    n = round((_BACK[0] + _BACK[1] * largest) * clip.fps)
    start, end = clip.velocities()[-1] / clip.fps * n, clip.velocities()[0] / clip.fps * n
    x = np.linspace(0.0, 1.0, n + 1)[1:, None]
    # Quintic with the ends' values and velocities and no acceleration.
    ease = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    leave = x - 6.0 * x**3 + 8.0 * x**4 - 3.0 * x**5
    arrive = -4.0 * x**3 + 7.0 * x**4 - 3.0 * x**5
    way = plus(np.repeat(last[None], n, axis=0), ease * difference + leave * start + arrive * end)
    way[-1] = first
    return Looped(Clip(np.vstack((clip.poses, way)), clip.fps, clip.name), "way back", 0.0, clip.duration, gap)


def _rested(clip: Clip) -> Looped:
    """The clip with its first and last velocities dying away, in poses before and after it that end on the floor."""
    if clip.n_frames < 2 or clip.fps * _REST < 2.0:
        return Looped(clip, "open", 0.0, clip.duration, 0.0)
    velocities = clip.velocities()
    before = _dying(clip.poses[0], -velocities[0], clip.fps)[::-1]
    after = _dying(clip.poses[-1], velocities[-1], clip.fps)
    poses = np.vstack((before, clip.poses, after))
    return Looped(Clip(poses, clip.fps, clip.name), "open", 0.0, clip.duration, 0.0)


def _dying(pose: Array, velocity: Array, fps: float) -> Array:
    """Poses in which a velocity dies away as (1 − x)² (1 + 2x), while the lowest part of the soles comes to the floor.

    The root has longer for it the faster it is, x = t/T; limbs would go past their limits if they had.
    """
    times = np.minimum(_REST + _REST_LONGER * float(np.linalg.norm(velocity[:2])), _REST_LONGEST), _REST
    n = round(times[0] * fps)
    x = np.minimum(np.arange(1, n + 1)[:, None] / (fps * np.array(times)), 1.0)
    path = (x - x**3 + x**4 / 2.0) * times
    poses = plus(np.repeat(pose[None], n, axis=0), path[:, np.repeat((0, 1), (3, len(velocity) - 3))] * velocity)
    low = sole_points(poses)[:, :, 2].min(axis=1) - CONTACT_RADIUS
    poses[:, 2] -= x[:, 0] ** 3 * (10.0 - 15.0 * x[:, 0] + 6.0 * x[:, 0] ** 2) * low
    return poses


def mirrored(clip: Clip) -> Clip:
    """The motion in a mirror: left and right exchanged."""
    twins = [
        BODIES.index(body.replace("left_", "right_") if body.startswith("left_") else body.replace("right_", "left_"))
        for body in BODIES
    ]
    poses = clip.poses.copy()
    poses[:, 1] *= -1.0
    rotations = poses[:, 3:].reshape(clip.n_frames, -1, 4)[:, twins] * np.array([1.0, -1.0, 1.0, -1.0])
    poses[:, 3:] = rotations.reshape(clip.n_frames, -1)
    return Clip(poses, clip.fps, clip.name)
