r"""Twist shared along an arm: where it goes beyond a joint's range, the arm's next segment takes it.

No position tells the turn of a segment about its own bone. Rigs put pronation into the wrist, which cannot twist, and
fits of captures to markers turn a nearly straight arm about its whole length at the shoulder and back at the wrist.
With R_u, R_f, R_h of upper arm, forearm and hand, and turns about the bones,

.. math:: R_u' = R_u R_y(\varphi_u), \quad R_f' = R_f R_y(\varphi_f), \quad R_h' = R_h,

every joint stays where it is and the hand as it is turned. φ_f takes what twists the wrist beyond its range, φ_u what
twists the shoulder beyond its own, as far as the elbow is straight: about a bent one it would turn the hinge, which
is told by positions. Both are zero within the ranges.
"""

import numpy as np

from models.arrays import Array
from models.humanoid.skeleton import BODIES, joint_range
from models.mocap import quaternions
from models.mocap.retargeting.body_lines import SIDES

_Y = 1  # the arms' long axis
_STRAIGHT, _BENT = np.cos(np.deg2rad([25.0, 50.0]))  # of an elbow that turns freely about the arm, and that does not
_ROUNDS = 3  # a turn about the bone changes the rotation vector's part along it by nearly as much


def with_twist_shared(segments: Array) -> Array:
    """Global rotations of the segments (n, 18, 4) whose arms twist within their ranges, where they can."""
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
    """Turn about the long axis that brings a joint (n, 4) into its range there [rad], shape (n,); 0 within it."""
    turn = np.zeros(len(joint))
    for _ in range(_ROUNDS):
        along = _vectors(quaternions.product(joint, quaternions.about_axis(_Y, turn)))[:, _Y]
        turn -= along - np.clip(along, low, high)
    return turn


def _vectors(joint: Array) -> Array:
    """Rotation vectors [rad] that go on beyond half a turn, most of them the shortest, shape (n, 3)."""
    q = quaternions.sign_continuous(joint)
    q = q if np.median(q[:, 0]) >= 0.0 else -q
    sine = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    return 2.0 * np.arctan2(sine, q[:, :1]) * q[:, 1:] / np.maximum(sine, 1e-12)
