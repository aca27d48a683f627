r"""Redistribution of twist along an arm: twist beyond a joint's range is moved to a neighbouring segment.

Joint positions do not determine the twist of a segment about its bone. Rigs put pronation into the wrist, which cannot
twist, and marker fits may rotate a nearly straight arm about its length at the shoulder and back at the wrist. With the
rotations R_u, R_f, R_h of upper arm, forearm and hand, and rotations R_y about the bones,

.. math:: R_u' = R_u R_y(\varphi_u), \quad R_f' = R_f R_y(\varphi_f), \quad R_h' = R_h,

leave all joint positions and the orientation of the hand unchanged. φ_f removes the twist of the wrist beyond its
range, φ_u that of the shoulder, in proportion to how straight the elbow is: at a bent elbow it would turn the hinge
axis, which positions do determine. Both are zero within the ranges.
"""

import numpy as np

from geometry import quaternions
from geometry.arrays import Array
from models.humanoid.skeleton import BODIES, joint_range
from models.mocap.retargeting.body_lines import SIDES

_LONG_AXIS = 1  # the arms' long axis
# Elbow angles up to which φ_u is applied fully, and from which it is zero: 12° for the first, and 30 or 90° for the
# second, change none of 17 captures.
_STRAIGHT_COSINE, _BENT_COSINE = np.cos(np.deg2rad([25.0, 50.0]))
# Fixed-point iterations: a twist changes the rotation vector's y component by nearly as much. Six change nothing else.
_ITERATION_COUNT = 3


def with_twist_shared(segments: Array) -> Array:
    """Global rotations of the segments (n, 18, 4) with the arms' twist brought within joint ranges where possible."""
    result = segments.copy()
    for side in SIDES:
        clavicle, upper, forearm, hand = (
            BODIES.index(f"{side}_{part}") for part in ("clavicle", "upper_arm", "forearm", "hand")
        )
        shoulder = quaternions.product(quaternions.conjugate(segments[:, clavicle]), segments[:, upper])
        wrist = quaternions.product(quaternions.conjugate(segments[:, forearm]), segments[:, hand])
        bones = quaternions.rotated(segments[:, [upper, forearm]], np.eye(3)[_LONG_AXIS])
        straightness = np.clip(
            (np.sum(bones[:, 0] * bones[:, 1], axis=1) - _BENT_COSINE) / (_STRAIGHT_COSINE - _BENT_COSINE), 0.0, 1.0
        )
        ranges = joint_range()[:, _LONG_AXIS]
        for body, angle in (
            (forearm, -_angle_into_range(wrist, *ranges[hand - 1])),
            (upper, straightness * _angle_into_range(shoulder, *ranges[upper - 1])),
        ):
            result[:, body] = quaternions.product(segments[:, body], quaternions.about_axis(_LONG_AXIS, angle))
    return result


def _angle_into_range(joint: Array, low: float, high: float) -> Array:
    """Rotation about the long axis that brings a joint (n, 4) within its range of twist [rad], shape (n,)."""
    angle = np.zeros(len(joint))
    for _ in range(_ITERATION_COUNT):
        twist = _continuous_vectors(quaternions.product(joint, quaternions.about_axis(_LONG_AXIS, angle)))[
            :, _LONG_AXIS
        ]
        angle -= twist - np.clip(twist, low, high)
    return angle


def _continuous_vectors(joint: Array) -> Array:
    """Rotation vectors [rad] continuous in time beyond half a turn, shape (n, 3); most are the shortest."""
    q = quaternions.sign_continuous(joint)
    q = q if np.median(q[:, 0]) >= 0.0 else -q
    sine = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    return 2.0 * np.arctan2(sine, q[:, :1]) * q[:, 1:] / np.maximum(sine, 1e-12)
