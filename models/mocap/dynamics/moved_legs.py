"""Inverse kinematics of the legs under a displaced body: standing feet keep their places, knees bend as hinges."""

import numpy as np

from geometry import quaternions
from geometry.arrays import Array
from geometry.two_links import reach
from models.humanoid.skeleton import BODIES, figure_model
from models.mocap.motion.kinematics import global_rotations, segment_positions

_MIN_FLEXION = np.deg2rad(3.6)  # of a knee whose foot is out of reach: 0.9995 of the leg's length
_CHAINS = tuple(
    tuple(BODIES.index(f"{side}_{part}") for part in ("thigh", "shank", "foot")) for side in ("left", "right")
)


def hip_to_ankle(poses: Array) -> tuple[Array, float]:
    """Vectors from hips to ankles in the world [m], shape (n, 2, 3), and the length of a straight leg [m]."""
    thigh, shank = _leg_bones()
    joints = segment_positions(poses[:, :3], global_rotations(poses))
    lines = [joints[:, foot] - joints[:, hip] for hip, _, foot in _CHAINS]
    return np.stack(lines, axis=1), float(np.linalg.norm(thigh) + np.linalg.norm(shank))


def displaced_with_planted_feet(poses: Array, shift: Array, planted: Array) -> Array:
    """Poses displaced as a whole except for standing feet.

    Parameters
    ----------
    poses : array, shape (n, 75)
        MuJoCo's qpos.
    shift : array, shape (n, 3)
        Displacement of the body [m].
    planted : array, shape (n, 2)
        Fraction of the displacement that each foot, left and right, does not follow: 1 keeps its place, 0 moves it with
        the body. Its orientation in the world is kept in any case.

    Returns
    -------
    array, shape (n, 75)
        The new poses. An ankle that would be out of reach is moved towards the hip.
    """
    thigh, shank = _leg_bones()
    segments = global_rotations(poses)
    moved = poses.copy()
    moved[:, :3] += shift
    for leg, (first, second, third) in enumerate(_CHAINS):
        upper = quaternions.rotated(segments[:, first], thigh)
        lower = quaternions.rotated(segments[:, second], shank)
        axis = np.cross(upper, lower)
        sine = np.linalg.norm(axis, axis=1)
        side = quaternions.rotated(segments[:, first], np.array([0.0, 1.0, 0.0]))
        # A straight knee defines no plane; it bends about the thigh's lateral axis.
        bent = sine > 0.03 * np.linalg.norm(thigh) * np.linalg.norm(shank)
        axis = np.where(bent[:, None], axis / np.maximum(sine, 1e-12)[:, None], side)
        displaced = np.abs(planted[:, leg]) * np.linalg.norm(shift, axis=1) > 1e-12
        bend, swing = reach(upper, lower, axis, upper + lower - planted[:, leg, None] * shift, -1.0, _MIN_FLEXION)
        bend, swing = (np.where(displaced[:, None], turn, (1.0, 0.0, 0.0, 0.0)) for turn in (bend, swing))
        new_thigh = quaternions.product(swing, segments[:, first])
        new_shank = quaternions.product(swing, quaternions.product(bend, segments[:, second]))
        for body, parent, child in (
            (first, segments[:, 0], new_thigh),
            (second, new_thigh, new_shank),
            (third, new_shank, segments[:, third]),
        ):
            moved[:, 3 + 4 * body : 7 + 4 * body] = quaternions.product(quaternions.conjugate(parent), child)
    return moved


def _leg_bones() -> tuple[Array, Array]:
    """Thigh and shank in their own frames [m]."""
    model = figure_model()
    return model.body("left_shank").pos, model.body("left_foot").pos
