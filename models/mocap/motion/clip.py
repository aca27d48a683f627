"""A clip: the figure's poses at equal steps of time."""

from dataclasses import dataclass
from numbers import Real
from typing import cast

import numpy as np
import numpy.typing as npt

from geometry import quaternions
from geometry.arrays import Array, rms
from models.errors import ModelError
from models.humanoid.skeleton import N_POSE, N_TANGENT, Pose

MOTION_BANDWIDTH = 8.0
"""Frequency [Hz] up to which motion is kept where noise is taken from it: with 6 and 15 Hz the residuals of eight
prepared captures are the same to 2 percentage points."""
CLOSURE_TOLERANCE = 1e-3
"""Largest gap between the ends of a clip that is repeated [rad], [m]: files are written with few digits."""

_UPSIDE_DOWN_COSINE = -0.5  # vertical component of the pelvis axis: a high kick leans by up to 97°, a cartwheel by 149°


def _float_array(name: str, poses: npt.ArrayLike) -> Array:
    try:
        array = np.asarray(poses)
    except ValueError:  # rows of different lengths
        array = np.array(None)
    if array.dtype.kind not in "iuf":
        raise ModelError(f"clip {name!r}: poses are no array of numbers; expected (frames ≥ 1, {N_POSE})")
    return array.astype(np.float64)


@dataclass(frozen=True)
class PlanarDisplacement:
    """A displacement over the floor: rotation by `yaw` about the world's z, then translation.

    Attributes
    ----------
    x, y : float
        Translation in the world frame [m].
    yaw : float
        Rotation [rad], −π to π.
    """

    x: float
    y: float
    yaw: float

    def moved(self, poses: Array) -> Array:
        """Displaced poses, shape (..., 75): p′ = R_z(yaw) p + (x, y, 0), q′ = R_z(yaw) q of the root."""
        turn = quaternions.about_axis(2, np.array(self.yaw))
        moved = np.array(poses, dtype=np.float64)
        moved[..., :3] = quaternions.rotated(turn, moved[..., :3]) + np.array([self.x, self.y, 0.0])
        moved[..., 3:7] = quaternions.product(turn, moved[..., 3:7])
        return moved

    def inverse(self) -> "PlanarDisplacement":
        """The displacement back."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return PlanarDisplacement(-c * self.x - s * self.y, s * self.x - c * self.y, -self.yaw)


@dataclass(frozen=True, eq=False, repr=False)
class Clip:
    """A motion of the figure; frame k is at time k / fps.

    Parameters
    ----------
    poses : array of shape (n, 75)
        MuJoCo's qpos per frame, n ≥ 1. Quaternions are normalised and their signs made continuous in time.
    fps : float
        Frames per second [1/s].
    name : str
        Name of the motion.

    Raises
    ------
    ModelError
        If the shape is wrong, a number is not finite, a quaternion is zero or the rate is not positive.
    """

    poses: Array
    fps: float
    name: str

    def __post_init__(self) -> None:
        if not isinstance(cast(object, self.name), str):
            raise ModelError(f"the name of a clip is {self.name!r}; expected text")
        poses = _float_array(self.name, self.poses)
        if poses.ndim != 2 or poses.shape[1] != N_POSE or len(poses) < 1:
            raise ModelError(f"clip {self.name!r}: poses have shape {poses.shape}; expected (frames ≥ 1, {N_POSE})")
        if not np.isfinite(poses).all():
            frame = int(np.argmin(np.isfinite(poses).all(axis=1)))
            raise ModelError(f"clip {self.name!r}: frame {frame} is not finite; expected finite numbers")
        if isinstance(self.fps, bool) or not isinstance(self.fps, Real) or not 0.0 < self.fps < np.inf:
            raise ModelError(f"clip {self.name!r}: {self.fps} frames per second; expected a positive number")
        rotations = poses[:, 3:].reshape(len(poses), -1, 4)
        norms = np.linalg.norm(rotations, axis=-1, keepdims=True)
        if norms.min() < 1e-6:
            frame = int(np.argmin(norms.min(axis=(1, 2))))
            raise ModelError(f"clip {self.name!r}: frame {frame} has a zero quaternion; expected unit quaternions")
        # Unit quaternions are left unchanged to the last bit, so that a clip made from a clip's poses is identical.
        norms[np.abs(norms - 1.0) < 1e-14] = 1.0
        poses[:, 3:] = quaternions.sign_continuous(rotations / norms).reshape(len(poses), -1)
        object.__setattr__(self, "poses", poses)

    @property
    def n_frames(self) -> int:
        """Number of frames n."""
        return len(self.poses)

    def __repr__(self) -> str:
        return f"<clip {self.name!r}, {self.duration:.2f} s at {self.fps:g} frames per second>"

    @property
    def duration(self) -> float:
        """Time from the first frame to the last [s]: (n − 1) / fps."""
        return (self.n_frames - 1) / self.fps

    @property
    def displacement(self) -> PlanarDisplacement:
        """Planar displacement from the first frame's root to the last one's: that of a lap, if the clip closes."""
        first, last = self.poses[0], self.poses[-1]
        turn = quaternions.product(last[3:7], quaternions.conjugate(first[3:7]))
        yaw = float(2.0 * np.arctan2(turn[3], turn[0]))
        yaw = float(np.remainder(yaw + np.pi, 2.0 * np.pi) - np.pi)
        start = quaternions.rotated(quaternions.about_axis(2, np.array(yaw)), first[:3])
        return PlanarDisplacement(float(last[0] - start[0]), float(last[1] - start[1]), yaw)

    @property
    def min_pelvis_cosine(self) -> float:
        """Least vertical component of the pelvis axis, −1 to 1."""
        return float((1.0 - 2.0 * (self.poses[:, 4] ** 2 + self.poses[:, 5] ** 2)).min())

    @property
    def turns_over(self) -> bool:
        """Whether the pelvis is upside down at some time, more than 120° from upright."""
        return self.min_pelvis_cosine < _UPSIDE_DOWN_COSINE

    def resized(self, size: float) -> "Clip":
        """The motion of a figure with lengths `size` times as long: p′ = size p of the root, the same rotations."""
        lengths = np.where(np.arange(N_POSE) < 3, size, 1.0)
        return Clip(self.poses * lengths, self.fps, self.name)

    def closes(self, tolerance: float = 1e-6) -> bool:
        """Whether the last frame is the first one displaced over the floor, within `tolerance` [rad], root [m]."""
        if self.n_frames < 2:
            return False
        gap = pose_difference(self.displacement.moved(self.poses[0]), self.poses[-1])
        joints = np.linalg.norm(gap[3:].reshape(-1, 3), axis=1)
        return bool(max(np.linalg.norm(gap[:3]), joints.max()) <= tolerance)

    def end_speed(self) -> float:
        """RMS of the joints' velocities at the faster of the two ends [rad/s]."""
        if self.n_frames < 2:
            return 0.0
        steps = pose_difference(self.poses[[0, -2]], self.poses[[1, -1]])[:, 6:]
        return self.fps * max(rms(steps[0]), rms(steps[1]))

    def with_next_lap(self) -> "Clip":
        """A closed clip and its next lap, continued from where the first ends: a flight over the seam is then whole."""
        return Clip(np.vstack((self.poses, self.displacement.moved(self.poses[1:]))), self.fps, self.name)

    def velocities(self) -> Array:
        r"""Tangents (MuJoCo's qvel) by central differences, shape (n, 57).

        .. math:: v_k = (\log(q_{k-1}^{-1} q_k) + \log(q_k^{-1} q_{k+1}))\, fps / 2

        Open clips have one-sided differences at their ends; a clip that closes is continued periodically.
        """
        if self.n_frames < 2:
            return np.zeros((1, N_TANGENT))
        steps = pose_difference(self.poses[:-1], self.poses[1:]) * self.fps
        before, after = np.vstack((steps[:1], steps)), np.vstack((steps, steps[-1:]))
        if self.closes():
            # The root's linear velocity, the only part in the world frame, rotates by the lap's yaw.
            turn = quaternions.about_axis(2, np.array(self.displacement.yaw))
            before[0], after[-1] = steps[-1], steps[0]
            before[0, :3] = quaternions.rotated(quaternions.conjugate(turn), steps[-1, :3])
            after[-1, :3] = quaternions.rotated(turn, steps[0, :3])
        return (before + after) / 2.0


def pose_difference(start: Pose, end: Pose) -> Array:
    """Tangent from `start` to `end` over unit time (mj_differentiatePos), shapes (..., 75) → (..., 57)."""
    start, end = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    shape = (*start.shape[:-1], -1, 4)
    turns = quaternions.product(quaternions.conjugate(start[..., 3:].reshape(shape)), end[..., 3:].reshape(shape))
    rotation = quaternions.logarithm(turns).reshape(*start.shape[:-1], -1)
    return np.concatenate((end[..., :3] - start[..., :3], rotation), axis=-1)


def pose_errors(poses: Array, reference: Array) -> tuple[Array, Array]:
    """Pose errors: RMS over the joints of the angle between their rotations [rad], and distance of the roots [m].

    Parameters
    ----------
    poses, reference : array, shape (n, 75)
        MuJoCo's qpos.

    Returns
    -------
    joints, root : array, shape (n,)
        The two errors of each pose.
    """
    difference = pose_difference(poses, reference)
    turns = difference[:, 6:].reshape(len(poses), -1, 3)
    return np.sqrt(np.mean(np.sum(turns**2, axis=2), axis=1)), np.linalg.norm(difference[:, :3], axis=1)
