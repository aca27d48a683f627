r"""Motions as points of a Euclidean space: distances are metres of body motion, regardless of the place on the ground.

.. math:: d^2 = (z - z')^2 + w_0^2 |R^\top e_z - R'^\top e_z|^2 + \sum_k w_k^2\, \bigl(2\sin\tfrac{\varphi_k}{2}\bigr)^2

z is the root's height, R its orientation, of which only the tilt counts, and φ_k the angle between the two rotations
of joint k: to second order the norm of the difference in tangent coordinates. With w_k the RMS distance by which one
radian of a joint moves the body, d is in metres. Velocities are compared likewise: those of the joints, and that of the
root in its own frame. The approach is that of motion graphs (Kovar, Gleicher & Pighin 2002).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from controllers.errors import ParameterError
from controllers.motion.loops import checked_clip
from geometry.arrays import Array, Mask
from geometry.quaternions import angular_velocities


@dataclass(frozen=True, eq=False)
class Motion:
    """A clip as input of lifting.

    Parameters
    ----------
    poses : Array, shape (n, nq)
        Root position, root quaternion, then joint quaternions (wxyz).
    fps : float
        Frames per second [1/s].
    name : str
    closed : bool
        Whether the last frame equals the first up to a displacement over the ground.
    supports : Mask, shape (n, k)
        Which of k feet bear load in each frame.
    strides : int
        Number of strides of a gait in the clip; 0 for other motions.

    Raises
    ------
    ParameterError
        If the poses are not those of a clip, or supports are not given for every frame.
    """

    poses: Array
    fps: float
    name: str
    closed: bool
    supports: Mask
    strides: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", checked_clip(self.poses, self.fps, f"clip {self.name!r}"))
        if self.supports.ndim != 2 or len(self.supports) != len(self.poses):
            raise ParameterError(
                f"clip {self.name!r}: supports have shape {self.supports.shape}, expected ({len(self.poses)}, feet)"
            )

    @property
    def duration(self) -> float:
        """Time from the first frame to the last [s]."""
        return (len(self.poses) - 1) / self.fps


class Features(NamedTuple):
    """A motion at n equal steps of its time, both ends included.

    Attributes
    ----------
    pose : Array, shape (n, p)
        Features of the pose [m].
    velocity : Array, shape (n, q)
        Features of the velocity [m/s].
    support : Array, shape (n, k)
        Whether each foot bears load, 0 to 1.
    """

    pose: Array
    velocity: Array
    support: Array

    def at(self, s: Array) -> "Features":
        """Features at shares s in [0, 1] of the motion's time, shape (...), linear between samples."""
        x = s * (len(self.pose) - 1)
        first = np.minimum(x.astype(np.int64), len(self.pose) - 2)
        share = (x - first)[..., None]
        return Features(*((1.0 - share) * part[first] + share * part[first + 1] for part in self))


def features(motion: Motion, weights: Array, samples: int) -> Features:
    """Pose and velocity of a motion as points of a Euclidean space.

    Parameters
    ----------
    motion : Motion
    weights : Array, shape (1 + joints,)
        w_k: displacement of the body per radian of root and joints, RMS over its mass [m].
    samples : int
        Number of equal steps of time, both ends included.

    Raises
    ------
    ParameterError
        If there is not one weight for the root and each joint.
    """
    rotations = (motion.poses.shape[1] - 3) // 4
    if weights.shape != (rotations,):
        raise ParameterError(
            f"clip {motion.name!r}: its poses have {rotations} rotations, there are {len(weights)} weights"
        )
    times = np.arange(len(motion.poses)) / motion.fps
    t = np.linspace(0.0, times[-1], samples)
    spline = CubicSpline(times, motion.poses, bc_type="natural")
    value, rate = np.asarray(spline(t)), np.asarray(spline(t, 1))
    q, dq = value[:, 3:].reshape(samples, -1, 4), rate[:, 3:].reshape(samples, -1, 4)
    norm = np.linalg.norm(q, axis=2, keepdims=True)
    matrix, spin = _rotation_matrices(q / norm), angular_velocities(q / norm, dq / norm) * weights[:, None]
    root = matrix[:, 0]
    tilt = weights[0] * root[:, 2, :]
    turns = (matrix[:, 1:] * (weights[1:, None, None] / np.sqrt(2.0))).reshape(samples, -1)
    advance = np.einsum("nji,nj->ni", root, rate[:, :3])
    support = np.stack([np.interp(t, times, foot) for foot in motion.supports.T.astype(float)], axis=1)
    return Features(
        np.concatenate([value[:, 2:3], tilt, turns], axis=1),
        np.concatenate([advance, spin.reshape(samples, -1)], axis=1),
        support,
    )


def _rotation_matrices(q: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def squared_distances(a: Array, b: Array) -> Array:
    """Squared distances between points (n, p) and (m, p), shape (n, m)."""
    square = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1) - 2.0 * (a @ b.T)
    return np.maximum(square, 0.0)
