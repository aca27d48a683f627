"""Mirror image of a motion."""

import numpy as np

from models.humanoid.skeleton import BODIES
from models.mocap.motion.clip import Clip


def mirrored(clip: Clip) -> Clip:
    """The mirror image of a motion: left and right exchanged."""
    twins = [
        BODIES.index(body.replace("left_", "right_") if body.startswith("left_") else body.replace("right_", "left_"))
        for body in BODIES
    ]
    poses = clip.poses.copy()
    poses[:, 1] *= -1.0
    rotations = poses[:, 3:].reshape(clip.n_frames, -1, 4)[:, twins] * np.array([1.0, -1.0, 1.0, -1.0])
    poses[:, 3:] = rotations.reshape(clip.n_frames, -1)
    return Clip(poses, clip.fps, clip.name)
