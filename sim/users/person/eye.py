r"""A person's vision: an estimate of her hand's place from the pose of the figure that she sees.

She has learned the map h along, and close to, the motion that she intends. From the pose q that she sees and the
place f where she feels her hand, she estimates the most likely place p. With standard deviations σ_q of the seen pose
and σ_f of the felt place, and λ = σ_q/σ_f,

.. math:: p = \varphi + H^+\bigl(q \ominus h(\varphi)\bigr) + (1 - H^+ H)(f - \varphi), \qquad
          H^+ = (H^T H + \lambda^2)^{-1} H^T, \qquad \varphi = \varphi(s^*), \\
          s^* = \arg\min_s \|q \ominus h(\varphi(s))\|^2 + \lambda^2 \|f - \varphi(s)\|^2

where H is the derivative of h by the hand's place. Directions that are not visible in the figure are taken from
proprioception: each sense is weighted by direction, as people combine vision and proprioception (van Beers, Sittig &
Gon 1999, J. Neurophysiol. 81: 1355-1364).
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from geometry.arrays import Array
from geometry.rotations import logarithm, relative

IMAGE_INTERVAL = 0.008  # [s] between two images of the figure: about 120 a second
_SEARCH_FRACTION = 1.0 / 8.0  # of the motion, around the felt place, searched for a pose: steps of a gait look alike


class Eye(NamedTuple):
    """What a person has learned of the figure along the intended motion; without poses she sees the stylus itself.

    Attributes
    ----------
    pose : Array
        The pose shown now, a view of the reference's, shape (75,); (0,) where no figure is shown.
    poses : Array
        Poses at n samples of the intended motion, shape (n, 75).
    places : Array
        Position of the stylus at each sample, in H [m], shape (n, 3).
    inverses : Array
        H⁺ at each sample, shape (n, 3, 57).
    unseen : Array
        1 − H⁺H at each sample, shape (n, 3, 3).
    trust : Array
        λ² at each sample [rad²/m²], shape (n,).
    """

    pose: Array
    poses: Array
    places: Array
    inverses: Array
    unseen: Array
    trust: Array


def no_eye() -> Eye:
    """The eye of a person to whom no figure is shown: she sees the stylus."""
    return Eye(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((0, 3, 0)), np.zeros((0, 3, 3)), np.zeros(0))


@njit
def _most_likely_sample(eye: Eye, felt: Array) -> int:
    """Index of the most likely sample of the motion for the pose shown, near the felt place of the hand."""
    n, q, nearest, best = eye.poses.shape[0], eye.pose, 0, np.inf
    squared_distance = np.zeros(n)
    for i in range(n):
        for k in range(3):
            squared_distance[i] += (felt[k] - eye.places[i, k]) ** 2
        if squared_distance[i] < best:
            nearest, best = i, squared_distance[i]
    best, likeliest, reach = np.inf, nearest, max(1, int(0.5 * _SEARCH_FRACTION * n))
    for step in range(-reach, reach + 1):
        i = (nearest + step) % n
        other, cost = eye.poses[i], eye.trust[i] * squared_distance[i]
        for k in range(3):
            cost += (q[k] - other[k]) ** 2
        for joint in range(3, q.shape[0], 4):
            dot = 0.0
            for k in range(joint, joint + 4):
                dot += q[k] * other[k]
            cost += 4.0 * (1.0 - dot * dot)
        if cost < best:
            best, likeliest = cost, i
    return likeliest


@njit
def seen_place(eye: Eye, felt: Array, difference: Array, place: Array) -> None:
    """Set the estimate p of the hand's place from the pose shown now (see the module's equations).

    Parameters
    ----------
    eye : Eye
        An eye with poses.
    felt : Array
        Felt place of the hand, f [m], shape (3,).
    difference : Array
        Scratch for the difference of two poses, shape (57,).
    place : Array
        Set: p [m], shape (3,).
    """
    q, i = eye.pose, _most_likely_sample(eye, felt)
    other = eye.poses[i]
    for k in range(3):
        difference[k] = q[k] - other[k]
    for joint in range((q.shape[0] - 3) // 4):
        r = 3 + 4 * joint
        a, b, c, d = relative(other[r], other[r + 1], other[r + 2], other[r + 3], q[r], q[r + 1], q[r + 2], q[r + 3])
        k = 3 + 3 * joint
        difference[k], difference[k + 1], difference[k + 2] = logarithm(a, b, c, d)
    for k in range(3):
        place[k] = eye.places[i, k]
        for j in range(difference.shape[0]):
            place[k] += eye.inverses[i, k, j] * difference[j]
        for j in range(3):
            place[k] += eye.unseen[i, k, j] * (felt[j] - eye.places[i, j])
