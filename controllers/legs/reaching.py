"""Offline inverse kinematics of a led clip: height of the root at which limbs reach their ends, and joint rotations.

At run time the map corrects limbs with a soft saturation (`limbs`). Where the path is straight, that correction leaves
rows unchanged whose joints already reach the ends exactly; so the exact solution is computed here beforehand.
"""

from collections.abc import Sequence

import numpy as np

from controllers.legs.limbs import N_END_CHANNELS, Limb
from controllers.motion.channels import signed_like
from geometry.arrays import Array
from geometry.quaternions import conjugate, product, rotated, unit
from geometry.two_links import reach

# Largest extension of a limb over its length. A led knee that gets straighter stops with 2500 rad/s², beyond its motor.
# Knees of eight led captures accelerate by up to 1040 rad/s²; with 0.98 by 810, with the root 0.8 cm lower; with 0.998
# by 1470.
_MAX_EXTENSION = 0.99


def extension(rows: Array, stride: float, limb: Limb, at: int) -> float:
    """Largest distance between a limb's first and last joint over the lap [m]; parameters as in `shortfall`."""
    return float(np.linalg.norm(_limb_vector(rows, stride, limb, at), axis=1).max())


def shortfall(rows: Array, stride: float, limb: Limb, at: int, longest: float) -> Array:
    """Lowering of the root that a limb needs to reach its end [m], shape (n,).

    Parameters
    ----------
    rows : Array, shape (n, nq + 4 limbs)
        Channels (`led`).
    stride : float
        Length of a lap [m], along x.
    limb : Limb
    at : int
        First column of the limb's end.
    longest : float
        Largest allowed extension [m], if more than `_MAX_EXTENSION` times the limb's length.
    """
    longest = max(_MAX_EXTENSION * float(np.linalg.norm(limb.offsets[1]) + np.linalg.norm(limb.offsets[2])), longest)
    line = _limb_vector(rows, stride, limb, at)
    horizontal = np.linalg.norm(line[:, :2], axis=1)
    return np.maximum(0.0, -line[:, 2] - np.sqrt(np.maximum(longest**2 - horizontal**2, 0.0)))


def solve_reach(rows: Array, stride: float, limbs: Sequence[Limb]) -> Array:
    """Channels (n, nq + 4 limbs) with the first two joints of each limb solved so that its last joint meets its end.

    The middle joint turns about its flexion axis, to the side to which it is bent on average (`geometry.two_links`).
    """
    result, first = rows.copy(), rows.shape[1] - N_END_CHANNELS * len(limbs)
    for j, limb in enumerate(limbs):
        columns = [slice(3 + 4 * joint, 7 + 4 * joint) for joint in limb.joints[:2]]
        upper, middle = (rows[:, column] for column in columns)
        line = rotated(conjugate(rows[:, 3:7]), _limb_vector(rows, stride, limb, first + N_END_CHANNELS * j))
        lower, (a, b) = product(upper, middle), limb.offsets[1:]
        axis = rotated(lower, unit(np.asarray(limb.axis)))
        bend, swing = reach(rotated(upper, a), rotated(lower, b), axis, line)
        solved = product(swing, upper), product(conjugate(upper), product(bend, lower))
        for column, turned in zip(columns, solved, strict=True):
            result[:, column] = signed_like(turned, rows[:, column])
    return result


def _limb_vector(channels: Array, stride: float, limb: Limb, at: int) -> Array:
    """Vector from a limb's first joint to its last, in the axes of the path [m], shape (n, 3)."""
    place = 3 + 4 * limb.joints[2]
    line = channels[:, at : at + 3] - rotated(channels[:, place : place + 4], limb.points.mean(axis=0))
    line[:, 0] += stride * channels[:, at + 3]
    return line - channels[:, :3] - rotated(channels[:, 3:7], limb.offsets[0])
