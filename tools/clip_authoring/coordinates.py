"""Minimal coordinates of the figure (57): position of the root, and rotation vectors of the root and the 17 joints.

They are in the order of MuJoCo's qvel. Unlike quaternions they form a linear space, so splines and least squares apply
to them. Joint limits are below half a turn, so no joint meets the singularity of rotation vectors at a full turn; the
root may rotate by a full turn (a backflip) if it does so about one axis.
"""

import numpy as np

from geometry import quaternions
from geometry.arrays import Array
from models.errors import ModelError
from models.humanoid.skeleton import JOINTS, N_POSE, N_TANGENT
from models.mocap.motion.clip import pose_difference

# Step of the finite differences for angular velocity and acceleration [s]. Half or twice the step changes the
# backflip's velocities (up to 10 rad/s) by 5e-5 or 2e-4, and its accelerations (up to 116 rad/s²) by 5e-4 or 2e-3.
_TIME_STEP = 1e-3


def coordinate(joint: str, axis: str) -> int:
    """Index of a coordinate, in the tangent's order.

    Parameters
    ----------
    joint : str
        ``position``, ``root`` or one of `JOINTS`.
    axis : str
        ``x``, ``y`` or ``z``.

    Raises
    ------
    ModelError
        If there is no such coordinate.
    """
    names = ("position", "root", *JOINTS)
    if joint not in names or axis not in ("x", "y", "z"):
        raise ModelError(f"there is no coordinate {joint} {axis}; joints: {', '.join(names)}; axes: x, y, z")
    return 3 * names.index(joint) + "xyz".index(axis)


def reflection() -> Array:
    """Matrix (57, 57) of the reflection in the x–z plane: sides swap; y and rotations about x and z change sign."""
    mirror = np.zeros((N_TANGENT, N_TANGENT))
    for i, joint in enumerate(("position", "root", *JOINTS)):
        side, _, rest = joint.partition("_")
        twin = {"left": "right_" + rest, "right": "left_" + rest}.get(side, joint)
        signs = (1.0, -1.0, 1.0) if joint == "position" else (-1.0, 1.0, -1.0)
        for axis, sign in zip("xyz", signs, strict=True):
            mirror[3 * i + "xyz".index(axis), coordinate(twin, axis)] = sign
    return mirror


def poses(coordinates: Array) -> Array:
    """MuJoCo poses of coordinates, shape (..., 57) → (..., 75); quaternions are exp(½ rotation vector)."""
    shape = coordinates.shape[:-1]
    pose = np.empty((*shape, N_POSE))
    pose[..., :3] = coordinates[..., :3]
    pose[..., 3:] = quaternions.exponential(coordinates[..., 3:].reshape(*shape, 18, 3)).reshape(*shape, 72)
    return pose


def states(u: Array, du: Array, ddu: Array) -> tuple[Array, Array, Array]:
    """MuJoCo's qpos, qvel, qacc from coordinates and two time derivatives, (m, 57) ×3 → (m, 75), (m, 57) ×2."""
    curvature = 0.5 * _TIME_STEP**2 * ddu
    before, now, after = poses(u - _TIME_STEP * du + curvature), poses(u), poses(u + _TIME_STEP * du + curvature)
    velocity, acceleration = du.copy(), ddu.copy()
    velocity[:, 3:] = pose_difference(before, after)[:, 3:] / (2 * _TIME_STEP)
    acceleration[:, 3:] = (pose_difference(now, after) - pose_difference(before, now))[:, 3:] / _TIME_STEP**2
    return now, velocity, acceleration
