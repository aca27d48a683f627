"""Operations on poses: adding tangents, resampling, low-pass filtering, periodic extension."""

import numpy as np
from scipy.interpolate import CubicSpline

from geometry import quaternions
from geometry.arrays import Array
from models.mocap.motion.clip import MOTION_BANDWIDTH, Clip

# −3 dB point of a second-order Butterworth filter that is run forwards and backwards, over its cut-off: (√2 − 1)^¼
# (Winter).
_TWO_PASS_RATIO = 0.802


def add_tangents(poses: Array, tangents: Array) -> Array:
    """Poses plus tangents, (..., 75) and (..., 57) → (..., 75): mj_integratePos over a unit of time."""
    moved = np.array(poses, dtype=np.float64)
    moved[..., :3] += tangents[..., :3]
    turn = quaternions.exponential(tangents[..., 3:].reshape(*tangents.shape[:-1], 18, 3))
    rotations = poses[..., 3:].reshape(*poses.shape[:-1], 18, 4)
    moved[..., 3:] = quaternions.product(rotations, turn).reshape(*poses.shape[:-1], 72)
    return moved


def resampled(clip: Clip, fps: float) -> Clip:
    """The same motion at another frame rate [1/s], by a cubic spline."""
    if abs(clip.fps - fps) < 1e-6 or clip.n_frames < 2:
        return clip
    times = np.arange(int(np.floor(clip.duration * fps + 1e-9)) + 1) / fps
    return Clip(CubicSpline(np.arange(clip.n_frames) / clip.fps, clip.poses)(times), fps, clip.name)


def smoothed(clip: Clip) -> Clip:
    """The motion low-passed at `MOTION_BANDWIDTH` without phase lag; a closed clip is extended periodically."""
    if clip.n_frames < 8 or 0.4 * clip.fps <= MOTION_BANDWIDTH:
        return clip
    from scipy.signal import butter, sosfiltfilt  # imported late: it loads scipy.stats, which is slow

    sections = np.asarray(butter(2, MOTION_BANDWIDTH / (clip.fps / 2.0) / _TWO_PASS_RATIO, output="sos"))
    pad = min(round(clip.fps), clip.n_frames - 2)
    if clip.closes():
        poses, first = extend_periodically(clip, pad)
        smooth = sosfiltfilt(sections, poses, axis=0, padlen=0)[first : first + clip.n_frames]
        smooth[-1] = clip.displacement.moved(smooth[0])
    else:
        smooth = sosfiltfilt(sections, clip.poses, axis=0, padlen=pad)
    return Clip(smooth, clip.fps, clip.name)


def extend_periodically(clip: Clip, margin: int) -> tuple[Array, int]:
    """A closed clip extended periodically by `margin` frames at both ends, and the index at which the clip begins.

    The signs of its quaternions are continuous.
    """
    lap, displacement = clip.poses[:-1], clip.displacement
    inverse = displacement.inverse()
    rows, first = [clip.poses], 0
    before, after = lap, clip.poses
    while first < margin:
        before = inverse.moved(before)
        rows.insert(0, before)
        first += len(lap)
    while sum(map(len, rows)) < first + clip.n_frames + margin:
        after = displacement.moved(after)
        rows.append(after[1:])
    poses = np.concatenate(rows)[first - margin : first + clip.n_frames + margin].copy()
    rotations = poses[:, 3:].reshape(len(poses), -1, 4)
    poses[:, 3:] = quaternions.sign_continuous(rotations).reshape(len(poses), -1)
    return poses, margin


def with_neighbours(clip: Clip, smooth: Clip) -> tuple[Array, Array, int]:
    """Poses of a clip and of its low-passed version, with a lap before and after if closed, and the clip's start."""
    if not clip.closes():
        return clip.poses, smooth.poses, 0
    poses, first = extend_periodically(clip, clip.n_frames)
    return poses, extend_periodically(smooth, clip.n_frames)[0], first
