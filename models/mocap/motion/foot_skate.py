r"""Foot skate, measured in two ways: how far a contact point slides, and how far it skates.

- The **slide** is the largest distance over the floor from where the contact began, :math:`\max_t \lVert x(t) - x(0)
  \rVert`: what a person sees of a run. It needs no stances, and is found while the run goes on.
- The **skate** is the largest distance from the median place of the stance, :math:`\max_t \lVert x(t) -
  \operatorname{med}_\tau x(\tau) \rVert`: how well one place on the floor describes a stance, which is what contact
  forces of a prepared motion need. It needs the whole stance.

A point that moves evenly through its contact skates half as far as it slides.

A foot of the physical figure rolls on its contact spheres, by some 1.5 cm when its heel rises, and does not slide then:
the part of the sphere that touches the floor rests, :math:`\dot c = r\,\omega \times e_z`. What a sphere has rolled
(`Rolling`) is taken from its places before its slide is measured. A foot of an animation turns about their centres.
"""

import numpy as np

from geometry import quaternions
from geometry.arrays import Array, Mask
from geometry.spans import spans


class ContactSlide:
    """Slide of k contact points, from blocks of frames.

    Attributes
    ----------
    largest : float
        Largest slide of a point so far [m].
    """

    def __init__(self) -> None:
        self.largest = 0.0
        self._origins: dict[int, Array] = {}

    def add(self, points: Array, touching: Mask) -> None:
        """Add places (n ≥ 1, k, 3) of the points [m], and whether they touch the floor (n, k), in order of time."""
        before, self._origins = self._origins, {}
        for k, touches in enumerate(touching.T):
            for start, end in spans(touches):
                path = points[start:end, k, :2]
                origin = before[k] if start == 0 and k in before else path[0]
                self.largest = max(self.largest, float(np.linalg.norm(path - origin, axis=1).max()))
                if end == len(points):
                    self._origins[k] = origin


class Rolling:
    r"""How far spheres of radius r have rolled over the floor, :math:`\int r\,\omega \times e_z\,dt`, from blocks."""

    def __init__(self, radius: float) -> None:
        self._radius, self._last, self._so_far = radius, np.empty(0), np.zeros(3)

    def add(self, rotations: Array) -> Array:
        """Add rotations (n ≥ 1, k, 4) in order of time; distances rolled since the first of all (n, k, 3) [m]."""
        before = np.concatenate((self._last if len(self._last) else rotations[:1], rotations[:-1]))
        turned = quaternions.logarithm(quaternions.product(rotations, quaternions.conjugate(before)))
        rolled = self._so_far + self._radius * np.cumsum(np.cross(turned, (0.0, 0.0, 1.0)), axis=0)
        self._last, self._so_far = rotations[-1:], rolled[-1]
        return rolled


def stance_skates(points: Array, standing: Mask) -> Array:
    """Skate of contact points (n, k, 3) in each of their stances, given by a mask (n, k) [m]; 0 without one."""
    skates = [0.0]
    for sphere, mask in enumerate(standing.T):
        for start, end in spans(mask):
            places = points[start:end, sphere, :2]
            skates.append(float(np.linalg.norm(places - np.median(places, axis=0), axis=1).max()))
    return np.array(skates if len(skates) == 1 else skates[1:])
