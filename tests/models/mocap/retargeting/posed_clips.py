"""Clips of the figure with joints at constant angles, or turned about an axis of the floor."""

from scipy.spatial.transform import Rotation

from models.humanoid.skeleton import BODIES
from models.mocap.motion.clip import Clip


def posed(turns, clip):
    """The clip with some joints at a constant angle about an axis [deg] from the rest pose."""
    poses = clip.poses.copy()
    for body, axis, degrees in turns:
        k = 3 + 4 * BODIES.index(body)
        poses[:, k : k + 4] = Rotation.from_euler(axis, degrees, degrees=True).as_quat(scalar_first=True)
    return Clip(poses, clip.fps, f"{clip.name} posed")


def rotated_about_the_origin(clip, axis, degrees, place=(0.0, 0.0, 0.0)):
    """The clip rotated about a horizontal axis through the origin of the floor, and moved [m]."""
    turn = Rotation.from_euler(axis, degrees, degrees=True)
    poses = clip.poses.copy()
    poses[:, :3] = turn.apply(poses[:, :3]) + place
    orientation = turn * Rotation.from_quat(poses[:, 3:7], scalar_first=True)
    poses[:, 3:7] = orientation.as_quat(scalar_first=True)
    return Clip(poses, clip.fps, f"{clip.name} turned about {axis} by {degrees}")
