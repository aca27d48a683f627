r"""Redistribution of twist along an arm: twist beyond a joint's range is moved to a neighbouring segment.

Joint positions do not determine the twist of a segment about its bone. Rigs put pronation into the wrist, which cannot
twist, and marker fits turn a nearly straight arm about its whole length at the shoulder and back at the wrist. With the
rotations R_u, R_f, R_h of upper arm, forearm and hand, and rotations R_y about the bones,

.. math:: R_u' = R_u R_y(\varphi_u), \quad R_f' = R_f R_y(\varphi_f), \quad R_h' = R_h,

leave all joint positions and the orientation of the hand unchanged. φ_f removes the twist of the wrist beyond its
range, φ_u that of the shoulder, in proportion to how straight the elbow is: at a bent elbow it would turn the hinge
axis, which positions do determine. Both are zero within the ranges.
"""

import numpy as np

from models.arrays import Array
from models.humanoid.skeleton import BODIES, joint_range
from models.mocap.motion import quaternions
from models.mocap.retargeting.body_lines import SIDES

_Y = 1  # the arms' long axis
# Elbow angles up to which φ_u is full, and from which it is zero: 12° for the first, 30 or 90° for the second, change
# none of 17 captures.
_STRAIGHT, _BENT = np.cos(np.deg2rad([25.0, 50.0]))
# Fixed-point iterations: a twist changes the rotation vector's y component by nearly as much. Six change nothing more.
_ROUNDS = 3


def with_twist_shared(segments: Array) -> Array:
    """Global rotations of the segments (n, 18, 4) with the arms' twist brought within joint ranges where possible."""
    shared = segments.copy()
    for side in SIDES:
        clavicle, upper, forearm, hand = (
            BODIES.index(f"{side}_{part}") for part in ("clavicle", "upper_arm", "forearm", "hand")
        )
        shoulder = quaternions.product(quaternions.conjugate(segments[:, clavicle]), segments[:, upper])
        wrist = quaternions.product(quaternions.conjugate(segments[:, forearm]), segments[:, hand])
        along = quaternions.rotated(segments[:, [upper, forearm]], np.eye(3)[_Y])
        straight = np.clip((np.sum(along[:, 0] * along[:, 1], axis=1) - _BENT) / (_STRAIGHT - _BENT), 0.0, 1.0)
        ranges = joint_range()[:, _Y]
        for body, angle in (
            (forearm, -_back(wrist, *ranges[hand - 1])),
            (upper, straight * _back(shoulder, *ranges[upper - 1])),
        ):
            shared[:, body] = quaternions.product(segments[:, body], quaternions.about_axis(_Y, angle))
    return shared


def _back(joint: Array, low: float, high: float) -> Array:
    """Rotation about the long axis that brings a joint (n, 4) within its range of twist [rad], shape (n,)."""
    turn = np.zeros(len(joint))
    for _ in range(_ROUNDS):
        along = _vectors(quaternions.product(joint, quaternions.about_axis(_Y, turn)))[:, _Y]
        turn -= along - np.clip(along, low, high)
    return turn


def _vectors(joint: Array) -> Array:
    """Rotation vectors [rad] continuous in time beyond half a turn, shape (n, 3); most are the shortest."""
    q = quaternions.sign_continuous(joint)
    q = q if np.median(q[:, 0]) >= 0.0 else -q
    sine = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    return 2.0 * np.arctan2(sine, q[:, :1]) * q[:, 1:] / np.maximum(sine, 1e-12)
