"""Input and output of a controller (hand state, wrench), and their layout in plain arrays.

The compiled loop passes a hand as one vector of `HAND_SIZE` numbers, in the hand frame H (z up, origin at the
device's zero configuration): ``[t, p (3), quaternion wxyz (4), v (3), ω (3), switch]``; a wrench as ``[F (3), τ
(3)]``, both in H, the moment about the stylus tip.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from numba import njit

from geometry.arrays import Array

Vec3: TypeAlias = Array
Quat: TypeAlias = Array
Pose: TypeAlias = Array
Tangent: TypeAlias = Array

HAND_TIME = 0
HAND_POSITION = 1
HAND_QUATERNION = 4
HAND_VELOCITY = 8
HAND_ANGULAR_VELOCITY = 11
HAND_SWITCH = 14
HAND_SIZE = 15

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
"""Orientation of the upright stylus, wxyz: its axes are parallel to those of H."""
MAX_TIME_STEP = 0.05
"""Largest time step by which states driven by the hand's clock advance [s], so that they do not jump after a pause."""

# Slices of the vector for use outside compiled code; a haptic map's argument is the stylus pose.
POSITION = slice(HAND_POSITION, HAND_QUATERNION)
STYLUS_POSE = slice(HAND_POSITION, HAND_VELOCITY)
VELOCITY = slice(HAND_VELOCITY, HAND_ANGULAR_VELOCITY)


class HandState(NamedTuple):
    """State of the hand as measured by the device at one tick.

    In compiled code (`hand_state`) vectors are tuples of floats.

    Attributes
    ----------
    t : float
        Time since the start of the run [s].
    p : Vec3
        p_H, the stylus tip [m].
    q : Quat
        R_H, orientation of the stylus, unit quaternion wxyz.
    v : Vec3
        Velocity of the tip in H [m/s].
    w : Vec3
        Angular velocity of the stylus in H [rad/s].
    switch : bool
        Whether the stylus switch is pressed.
    """

    t: float
    p: Vec3
    q: Quat
    v: Vec3
    w: Vec3
    switch: bool = False

    @staticmethod
    def at(p: npt.ArrayLike, v: npt.ArrayLike = (0.0, 0.0, 0.0), t: float = 0.0) -> "HandState":
        """Hand at position p [m] with velocity v [m/s] at time t [s]; stylus upright, not turning, switch open."""
        return HandState(t, np.asarray(p, dtype=float), np.array(UPRIGHT), np.asarray(v, dtype=float), np.zeros(3))

    @staticmethod
    def of(vector: Array) -> "HandState":
        """Hand state from a vector of `HAND_SIZE` numbers."""
        p, q, v = vector[HAND_POSITION:HAND_QUATERNION], vector[HAND_QUATERNION:HAND_VELOCITY], vector[HAND_VELOCITY:]
        w = vector[HAND_ANGULAR_VELOCITY:HAND_SWITCH].copy()
        return HandState(float(vector[HAND_TIME]), p.copy(), q.copy(), v[:3].copy(), w, vector[HAND_SWITCH] > 0.0)

    def vector(self) -> Array:
        """Array of the `HAND_SIZE` numbers that compiled laws read."""
        return np.concatenate(([self.t], self.p, self.q, self.v, self.w, [float(self.switch)]))


@njit
def hand_state(vector: Array) -> HandState:
    """Hand state from a vector of `HAND_SIZE` numbers, in compiled code: p, q, v and w are tuples."""
    return HandState(
        vector[HAND_TIME],
        (vector[1], vector[2], vector[3]),  # pyright: ignore[reportArgumentType]
        (vector[4], vector[5], vector[6], vector[7]),  # pyright: ignore[reportArgumentType]
        (vector[8], vector[9], vector[10]),  # pyright: ignore[reportArgumentType]
        (vector[11], vector[12], vector[13]),  # pyright: ignore[reportArgumentType]
        vector[HAND_SWITCH] > 0.0,
    )


def stylus_path(points: Array) -> Array:
    """Stylus poses at points of H with the stylus upright, shape (n, 3) → (n, 7)."""
    return np.hstack((points, np.tile(UPRIGHT, (len(points), 1))))


class Wrench(NamedTuple):
    """Force and moment on the hand.

    Attributes
    ----------
    force : Vec3
        F_H at the stylus tip [N].
    torque : Vec3
        τ_H about the stylus tip [N m].
    """

    force: Vec3
    torque: Vec3
