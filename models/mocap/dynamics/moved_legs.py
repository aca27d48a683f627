"""Inverse kinematics of the legs under a displaced body: standing feet keep their places, knees bend as hinges."""

import numpy as np

from models.arrays import Array
from models.humanoid.skeleton import BODIES, figure_model
from models.mocap.motion import quaternions
from models.mocap.motion.clip import global_rotations

_REACH = 0.9995  # largest distance from hip to ankle as a share of the leg's length: a knee bent by 3.6°
_CHAINS = tuple(
    tuple(BODIES.index(f"{side}_{part}") for part in ("thigh", "shank", "foot")) for side in ("left", "right")
)


def leg_lines(poses: Array) -> tuple[Array, float]:
    """Vectors from hips to ankles in the world [m], shape (n, 2, 3), and the length of a straight leg [m]."""
    thigh, shank = _bones()
    segments = global_rotations(poses)
    lines = [
        quaternions.rotated(segments[:, first], thigh) + quaternions.rotated(segments[:, second], shank)
        for first, second, _ in _CHAINS
    ]
    return np.stack(lines, axis=1), float(np.linalg.norm(thigh) + np.linalg.norm(shank))


def with_moved_body(poses: Array, shift: Array, planted: Array) -> Array:
    """Poses displaced as a whole except for standing feet.

    Parameters
    ----------
    poses : array, shape (n, 75)
        MuJoCo's qpos.
    shift : array, shape (n, 3)
        Displacement of the body [m].
    planted : array, shape (n, 2)
        Share of the displacement that each foot, left and right, does not take: 1 keeps its place, 0 moves it with the
        body. Its orientation in the world is kept in any case.

    Returns
    -------
    array, shape (n, 75)
        The new poses. An ankle that would be out of reach is moved along the line to the hip.
    """
    thigh, shank = _bones()
    a, b = float(np.linalg.norm(thigh)), float(np.linalg.norm(shank))
    segments = global_rotations(poses)
    moved = poses.copy()
    moved[:, :3] += shift
    for leg, (first, second, third) in enumerate(_CHAINS):
        upper = quaternions.rotated(segments[:, first], thigh)
        lower = quaternions.rotated(segments[:, second], shank)
        wanted = upper + lower - planted[:, leg, None] * shift
        distance = np.minimum(np.linalg.norm(wanted, axis=1), _REACH * (a + b))
        axis = np.cross(upper, lower)
        sine = np.linalg.norm(axis, axis=1)
        side = quaternions.rotated(segments[:, first], np.array([0.0, 1.0, 0.0]))
        # A straight knee defines no plane; it bends about the thigh's lateral axis.
        axis = np.where((sine > 0.03 * a * b)[:, None], axis / np.maximum(sine, 1e-12)[:, None], side)
        now = np.arctan2(np.sum(np.cross(upper, lower) * axis, axis=1), np.sum(upper * lower, axis=1))
        then = np.arccos(np.clip((distance**2 - a * a - b * b) / (2.0 * a * b), -1.0, 1.0))
        changed = np.abs(planted[:, leg]) * np.linalg.norm(shift, axis=1) > 1e-12
        bend = _turn(axis, np.where(changed, then - np.abs(now), 0.0))
        now_at, wanted_at = upper + quaternions.rotated(bend, lower), np.where(changed[:, None], wanted, upper + lower)
        swing = quaternions.arcs(_unit(now_at), _unit(wanted_at))
        new_thigh = quaternions.product(swing, segments[:, first])
        new_shank = quaternions.product(swing, quaternions.product(bend, segments[:, second]))
        for body, parent, child in (
            (first, segments[:, 0], new_thigh),
            (second, new_thigh, new_shank),
            (third, new_shank, segments[:, third]),
        ):
            moved[:, 3 + 4 * body : 7 + 4 * body] = quaternions.product(quaternions.conjugate(parent), child)
    return moved


def _bones() -> tuple[Array, Array]:
    """Thigh and shank in their own frames [m]."""
    model = figure_model()
    return model.body("left_shank").pos, model.body("left_foot").pos


def _turn(axis: Array, angle: Array) -> Array:
    """Rotations about unit axes (n, 3) by angles (n,), shape (n, 4)."""
    half = angle[:, None] / 2.0
    return np.concatenate([np.cos(half), np.sin(half) * axis], axis=1)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
