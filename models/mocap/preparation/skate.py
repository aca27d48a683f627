"""Foot skate of a clip: in the stances of its contact schedule."""

import numpy as np

from geometry.arrays import Array
from models.humanoid.skeleton import CONTACT_RADIUS
from models.mocap.dynamics.floor_forces import ALL_CONTACTS
from models.mocap.motion.clip import Clip
from models.mocap.motion.foot_skate import stance_skates
from models.mocap.motion.kinematics import contact_points
from models.mocap.preparation.stances import Stances

# Half or twice the first of these bounds changes the faults found in 6 and 3 of 26 clips (nine embedded clips and 17
# captures); half or twice the others changes none.
MAX_REST_SPEED = 0.2  # speed above which a part of a sole rolls on or off the floor, and is not on it [m/s]
_MIN_LOAD = 0.02  # vertical force below which a contact point that moves is in swing [body weights]
_MAX_FLOOR_HEIGHT = 0.015  # height above which a contact point does not skate [m]


def skates(clip: Clip, schedule: Stances, loads: Array) -> Array:
    """Skate of each contact point in each of its stances (`models.mocap.motion.foot_skate`) [m]; 0 without one.

    A point that bears less than 2 % of the body's weight while it moves by more than 0.2 m/s is in swing, however low:
    a toe that rolls off, or a foot in a low hop.

    Parameters
    ----------
    clip : Clip
    schedule : Stances
        Its contact schedule.
    loads : Array, shape (n, k)
        Vertical forces on its contact points [body weights], from `feasible.contact_forces`.
    """
    points, speeds = moving_points(clip, schedule)
    low = points[:, :, 2] - CONTACT_RADIUS < _MAX_FLOOR_HEIGHT
    swinging = (loads < _MIN_LOAD) & (speeds > MAX_REST_SPEED)
    return stance_skates(points, schedule.standing & low & ~swinging)


def loaded_slide(clip: Clip, schedule: Stances, loads: Array) -> float:
    """Largest skate of a point under load while no foot rests [m], as where feet jump across a seam; see `skates`."""
    points, _ = moving_points(clip, schedule)
    low = points[:, :, 2] - CONTACT_RADIUS < _MAX_FLOOR_HEIGHT
    return float(stance_skates(points, schedule.sliding & low & (loads >= _MIN_LOAD)).max())


def moving_points(clip: Clip, schedule: Stances) -> tuple[Array, Array]:
    """Places (n, k, 3) [m] and speeds (n, k) [m/s] of the contact points of a schedule."""
    points = contact_points(clip.poses, ALL_CONTACTS[: schedule.standing.shape[1]])
    if clip.n_frames < 2:
        return points, np.zeros(points.shape[:2])
    return points, np.linalg.norm(np.gradient(points, axis=0), axis=2) * clip.fps
