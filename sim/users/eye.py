r"""What a person sees: the animation's pose, and where on the motion that she has in mind such a pose belongs.

She has learned what the figure does along that motion and a little beside it, so a pose q tells her a place

.. math:: p = \varphi(s^*) + H^+(s^*)\,\bigl(q \ominus h(\varphi(s^*))\bigr), \qquad
          s^* = \arg\min_s \|q \ominus h(\varphi(s))\|

with H⁺ a damped inverse of the map's derivative: what does not show in the figure she cannot see.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.rotations import logarithm, relative

Array = npt.NDArray[np.float64]

LOOKS = 0.008  # [s] between two pictures of the figure, at most: 120 a second
_NEAR = 1.0 / 3.0  # of the motion, around where she last saw it, in which she looks for a pose


class Eye(NamedTuple):
    """What a person compares a pose with; without poses she sees the stylus itself.

    Attributes
    ----------
    pose : Array
        The animation's pose now, that of the reference itself, shape (75,); (0,) where no figure is shown.
    poses : Array
        Poses along the motion that she has in mind, shape (n, 75).
    places : Array
        Where the stylus is then, in H [m], shape (n, 3).
    inverses : Array
        H⁺ there, shape (n, 3, 57).
    """

    pose: Array
    poses: Array
    places: Array
    inverses: Array


def no_eye() -> Eye:
    """No figure is shown: she sees the stylus."""
    return Eye(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((0, 3, 0)))


@njit
def seen_place(eye: Eye, last: int, difference: Array, place: Array) -> int:
    """Set the place (3,) that the pose shown now tells, and return which of the poses along the motion is nearest.

    Parameters
    ----------
    eye : Eye
        With poses.
    last : int
        Which one was nearest before; negative where none was.
    difference : Array
        Room for the difference of two poses, shape (57,).
    place : Array
        Set [m].
    """
    n, q = eye.poses.shape[0], eye.pose
    best, nearest = np.inf, 0
    reach = n // 2 if last < 0 else max(1, int(_NEAR * n) // 2)
    for step in range(-reach, reach + 1):
        i = (max(last, 0) + step) % n
        other, far = eye.poses[i], 0.0
        for k in range(3):
            far += (q[k] - other[k]) ** 2
        for joint in range(3, q.shape[0], 4):
            dot = 0.0
            for k in range(joint, joint + 4):
                dot += q[k] * other[k]
            far += 4.0 * (1.0 - dot * dot)
        if far < best:
            best, nearest = far, i
    other = eye.poses[nearest]
    for k in range(3):
        difference[k] = q[k] - other[k]
    for j in range((q.shape[0] - 3) // 4):
        i = 3 + 4 * j
        a, b, c, d = relative(other[i], other[i + 1], other[i + 2], other[i + 3], q[i], q[i + 1], q[i + 2], q[i + 3])
        difference[3 + 3 * j], difference[4 + 3 * j], difference[5 + 3 * j] = logarithm(a, b, c, d)
    for k in range(3):
        place[k] = eye.places[nearest, k]
        for j in range(difference.shape[0]):
            place[k] += eye.inverses[nearest, k, j] * difference[j]
    return nearest
