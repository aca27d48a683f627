"""Balance of an authored cyclic motion: the sway of the pelvis that brings its zero-moment point under the feet."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import Array, Mask
from geometry.physics import GRAVITY
from models.humanoid.skeleton import CONTACT_RADIUS, figure_model
from models.mocap.dynamics.momentum import momentum
from models.mocap.dynamics.zero_moment_point import nearest_supported, sway_of, zero_moment_point
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import sole_points
from tools.clip_authoring.key_poses import Choreography, poses_at

# Height below which a contact sphere supports the body [m], at any speed: unlike captured ones (`contacts`), authored
# soles are exact.
_SUPPORT_HEIGHT = 0.006
_CUTOFF_FREQUENCY, _ITERATION_COUNT = 8.0, 12  # highest frequency of the sway [Hz], and iterations of its correction
_SUPPORT_SCALE = 0.7  # scale, about its middle, of the support polygon in which the zero-moment point must lie


class Dynamics(NamedTuple):
    """Ground reaction force that a motion needs, frame by frame.

    Attributes
    ----------
    com : array, shape (n, 3)
        Centre of mass [m].
    force : array, shape (n, 3)
        Ground reaction force [N].
    zmp : array, shape (n, 2)
        Zero-moment point on the floor [m].
    contacts : array, shape (n, 8, 3)
        Centres of the feet's contact spheres [m], in the order of `FOOT_CONTACTS`.
    """

    com: Array
    force: Array
    zmp: Array
    contacts: Array

    @property
    def touching(self) -> Mask:
        """Which contact spheres support the body, shape (n, 8)."""
        return self.contacts[..., 2] < CONTACT_RADIUS + _SUPPORT_HEIGHT


def dynamics(clip: Clip) -> Dynamics:
    """Centre of mass, ground reaction and zero-moment point of a clip that closes in place, by finite differences.

    Parameters
    ----------
    clip : Clip
        A cyclic clip whose last frame is its first, without displacement.

    Returns
    -------
    Dynamics
        One row for each frame but the last.
    """
    com, angular, _ = momentum(clip)
    com, angular, contacts = com[:-1], angular[:-1], sole_points(clip.poses[:-1])
    acceleration = (np.roll(com, -1, axis=0) - 2 * com + np.roll(com, 1, axis=0)) * clip.fps**2
    force = figure_model().body_subtreemass[1] * (acceleration + np.array([0.0, 0.0, GRAVITY]))
    torque = (np.roll(angular, -1, axis=0) - np.roll(angular, 1, axis=0)) * clip.fps / 2
    return Dynamics(com, force, zero_moment_point(com, force, torque), contacts)


def balanced_clip(choreography: Choreography, fps: float) -> Clip:
    """Sample a cyclic in-place choreography with a sway of the pelvis that keeps the zero-moment point under the feet.

    The sway of the cart-table model (`sway_of`) is iterated with the exact dynamics.

    Parameters
    ----------
    choreography : Choreography
        The motion; its sway is added to the x and y of its keys.
    fps : float
        Frame rate [1/s].

    Returns
    -------
    Clip
        One lap, its last frame closing on the first.
    """
    n = round(choreography.duration * fps)
    t = np.linspace(0.0, choreography.duration, n + 1)
    sway = np.zeros((n + 1, 2))
    for _ in range(_ITERATION_COUNT):
        motion = dynamics(Clip(poses_at(choreography, t, sway), fps, choreography.name))
        target = nearest_supported(motion.zmp, motion.contacts[..., :2], motion.touching, _SUPPORT_SCALE)
        # A sway adds a moment, which moves the zero-moment point further where the vertical force is smaller.
        load = np.maximum(motion.force[:, 2:] / motion.force[:, 2].mean(), 0.0)
        error = load * (target - motion.zmp)
        change = sway_of(error, motion.com[:, 2].mean(), choreography.duration, _CUTOFF_FREQUENCY)
        sway += np.vstack([change, change[:1]])
    return Clip(poses_at(choreography, t, sway), fps, choreography.name)
