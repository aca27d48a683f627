r"""A clip as a smooth motion: poses, velocities and accelerations at any time, lap after lap.

Each component of the pose is a C² cubic spline s(t) through the frames; a rotation is q = s/‖s‖, with

.. math:: \omega = \frac{2\,\mathrm{vec}(\bar s \dot s)}{\|s\|^2}, \qquad
          \dot\omega = \frac{2\,\mathrm{vec}(\bar s \ddot s)}{\|s\|^2} - \frac{2\,(s \cdot \dot s)}{\|s\|^2}\,\omega

in the body's own frame, as in MuJoCo's qvel.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from geometry.arrays import Array
from geometry.quaternions import angular_velocities, with_continuous_signs
from models.humanoid.skeleton import N_POSE, N_TANGENT
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip

_N_MARGIN_FRAMES = 8  # of the neighbouring laps at each end: the effect of a spline's end decays to 0.27⁸ = 3e-5


class ClipMotion(NamedTuple):
    """Samples of a motion.

    Attributes
    ----------
    times : Array
        Shape (n,) [s].
    poses : Array
        qpos, shape (n, 75).
    velocities, accelerations : Array
        qvel and its derivative, shape (n, 57) [m/s, rad/s, m/s², rad/s²].
    """

    times: Array
    poses: Array
    velocities: Array
    accelerations: Array


def clip_motion(clip: Clip, times: Array) -> ClipMotion:
    """Sample a clip. A closed clip is repeated, each lap displaced by the clip's travel; any other holds its last pose.

    Parameters
    ----------
    clip : Clip
        Frame k is at time k / fps.
    times : Array
        Shape (n,), ≥ 0 [s].
    """
    frames, first = _frames(clip, float(times.max()))
    spline = CubicSpline((np.arange(len(frames)) - first) / clip.fps, frames)
    s, ds, dds = spline(times), spline(times, 1), spline(times, 2)
    n = len(times)
    poses, velocities, accelerations = np.empty((n, N_POSE)), np.empty((n, N_TANGENT)), np.empty((n, N_TANGENT))
    poses[:, :3], velocities[:, :3], accelerations[:, :3] = s[:, :3], ds[:, :3], dds[:, :3]
    shape = (n, -1, 4)
    q, dq, ddq = s[:, 3:].reshape(shape), ds[:, 3:].reshape(shape), dds[:, 3:].reshape(shape)
    square = np.sum(q * q, axis=-1, keepdims=True)
    omega = angular_velocities(q, dq) / square
    alpha = angular_velocities(q, ddq) / square - 2.0 * np.sum(q * dq, axis=-1, keepdims=True) / square * omega
    poses[:, 3:] = (q / np.sqrt(square)).reshape(n, -1)
    velocities[:, 3:], accelerations[:, 3:] = omega.reshape(n, -1), alpha.reshape(n, -1)
    return ClipMotion(times, poses, velocities, accelerations)


def _frames(clip: Clip, end: float) -> tuple[Array, int]:
    """Frames from before time 0 to beyond `end` [s], and the index of the frame at time 0."""
    n_needed = int(np.ceil(end * clip.fps)) + _N_MARGIN_FRAMES + 1
    if not clip.closes(CLOSURE_TOLERANCE):
        held_frames = np.repeat(clip.poses[-1:], max(n_needed - clip.n_frames, 1), axis=0)
        return np.concatenate((clip.poses, held_frames)), 0
    lap = clip.poses[:-1]
    laps = [lap]
    while sum(map(len, laps)) < n_needed:
        laps.append(clip.displacement.moved(laps[-1]))
    previous_lap = clip.displacement.inverse().moved(lap)
    margin = min(_N_MARGIN_FRAMES, len(lap))
    frames = np.concatenate((previous_lap[len(previous_lap) - margin :], *laps))
    rotations = with_continuous_signs(frames[:, 3:].reshape(len(frames), -1, 4))
    return np.concatenate((frames[:, :3], rotations.reshape(len(frames), -1)), axis=1), margin
