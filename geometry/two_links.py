"""Inverse kinematics of two links, such as thigh and shank: the first joint turns freely, the middle one is a hinge."""

import numpy as np

from geometry.arrays import Array
from geometry.quaternions import arcs, exponential, rotated, unit

# [rad] least flexion of the middle joint, for an end out of reach: 0.9999 of the length. Others extend less: to 0.9995
# in `models.mocap.dynamics.moved_legs`; to 0.99 in `legs.reaching`, so that knees stop gently; to 0.95 in
# `legs.stepping_limbs`, where the root is lowered beyond it; to 0.998 in `flight.repair`, unless the clip itself
# extends its legs further.
MIN_FLEXION = 0.03


def reach(
    a: Array, b: Array, axis: Array, line: Array, side: float | None = None, min_flexion: float = MIN_FLEXION
) -> tuple[Array, Array]:
    r"""Rotations of two links that bring their end onto given lines, as nearly as the links' lengths allow.

    With b turned by δ about the hinge, |a|² + |b|² + 2 (A + B cos δ + C sin δ) = |line|².

    Parameters
    ----------
    a, b : Array, shape (n, 3)
        The links in a common frame [m].
    axis : Array, shape (n, 3)
        Unit vectors along the hinge.
    line : Array, shape (n, 3)
        Required vectors from the first joint to the end [m].
    side : float, optional
        Sign of the hinge's angle from flexed to straight; by default that of the mean, so that a knee that is
        hyperextended in some frames bends normally.
    min_flexion : float
        Least flexion of the middle joint, for an end out of reach [rad].

    Returns
    -------
    bend, swing : Array, shape (n, 4)
        Rotation of the second link about the middle joint, and then of both by the smallest angle about the first.
    """
    along = np.sum(a * axis, axis=1) * np.sum(b * axis, axis=1)
    cosine, sine = np.sum(a * b, axis=1) - along, np.sum(a * np.cross(axis, b), axis=1)
    straight = np.arctan2(sine, cosine)
    wanted = (0.5 * (line**2 - a**2 - b**2).sum(axis=1) - along) / np.hypot(cosine, sine)
    flexion = np.arccos(np.clip(wanted, -1.0, np.cos(min_flexion)))
    turn = straight - np.sign(straight.mean() if side is None else side) * flexion
    bend = exponential(turn[:, None] * axis)
    return bend, arcs(unit(a + rotated(bend, b)), unit(line))
