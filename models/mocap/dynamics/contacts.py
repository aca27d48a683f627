"""Contact detection: which parts of the body touch the floor, robust to errors of some centimetres in captures.

A part of the body that bears load is near the floor *and* at rest. Height alone does not suffice: the soles of runners
clear the floor by less than a capture's standing feet may hover above it. Hands are supported by fingers, which the
figure lacks, so their height threshold is larger.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from models.arrays import Array, Mask
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, HAND_CONTACTS, figure_model
from models.mocap.motion.clip import Clip

# Height below which a part touches at any speed [m]: half or twice changes whether a body is supported in 0.8 % of the
# frames of 17 captures.
_CERTAIN = 0.005
# Height above which it does not touch at any speed [m]: captured feet hover by 3 cm or more; hands lack fingers.
# Half or twice of either changes whether a body is supported in 0.1 % of the frames of 17 captures.
_REACH, HAND_REACH = 0.06, 0.12
# Speed below which it rests [m/s]: soles slip and roll more slowly in stance, and pass faster in swing. Knees of
# eight led captures accelerate by up to 1040 rad/s², with half of it 700 (and roots 1 cm lower), with twice 2090; the
# worst slides 3.0, 3.3 and 4.0 cm.
_SLOW = 0.6
# Largest height of a settled foot over the median of its stance [m]: half or twice of it moves led slides by 0.7 cm.
_HIGHER = 0.005
# A part below this height [m] and vertical speed [m/s] slides over the floor. Half of the first changes whether a body
# is supported in 1.2 % of these frames, twice in 0.2 %; half or twice of the second in 0.6 %.
_LOW, _LEVEL = 0.03, 0.25


class Contacts(NamedTuple):
    """Contacts of m parts of the body with the floor over n frames.

    Attributes
    ----------
    heights : array, shape (n, m)
        Heights of the parts' lowest points [m]: the feet's 8 contact spheres, the hands' 2, then all other geoms.
    touching : array of bool, shape (n, m)
        Whether a part is taken to bear load.
    resting : array of bool, shape (n, m)
        Whether it does so at rest; a foot that slides over the floor in mid-swing does not rest.
    """

    heights: Array
    touching: Mask
    resting: Mask

    @property
    def clearance(self) -> Array:
        """Height of the lowest point of the body [m], shape (n,)."""
        return self.heights.min(axis=1)

    @property
    def supported(self) -> Mask:
        """Whether anything bears load, shape (n,)."""
        return np.any(self.touching, axis=1)

    @property
    def standing(self) -> Mask:
        """Whether each foot bears load, left and right, shape (n, 2)."""
        return np.stack([self.touching[:, :4].any(axis=1), self.touching[:, 4:8].any(axis=1)], axis=1)

    @property
    def planted(self) -> Mask:
        """Whether each foot stands at rest, left and right, shape (n, 2)."""
        return np.stack([self.resting[:, :4].any(axis=1), self.resting[:, 4:8].any(axis=1)], axis=1)

    @property
    def settled(self) -> Mask:
        """Whether each foot stands at rest and near the median height of its stance, left and right, shape (n, 2)."""
        settled = self.planted
        for foot, stands in enumerate(settled.T):
            lowest = self.heights[:, 4 * foot : 4 * foot + 4].min(axis=1)
            edges = np.flatnonzero(np.diff(np.concatenate(([0], stands.astype(int), [0]))))
            for start, end in zip(edges[::2], edges[1::2], strict=True):
                level = float(np.median(lowest[start:end]))
                settled[start:end, foot] = lowest[start:end] < level + _HIGHER
        return settled


def contacts(clip: Clip) -> Contacts:
    """Contacts of the figure with the floor z = 0 in each frame of a clip."""
    model = figure_model()
    data = mujoco.MjData(model)
    spheres = [int(model.geom(name).id) for name in FOOT_CONTACTS + HAND_CONTACTS]
    ends = {int(model.geom_bodyid[geom]) for geom in spheres}
    others = [geom for geom in range(model.ngeom) if int(model.geom_bodyid[geom]) not in ends]
    middle, half = model.geom_aabb[others, :3], model.geom_aabb[others, 3:]
    places = np.empty((clip.n_frames, len(spheres) + len(others), 3))
    for k, pose in enumerate(clip.poses):
        data.qpos = pose
        mujoco.mj_kinematics(model, data)
        R = data.geom_xmat[others].reshape(-1, 3, 3)
        places[k, : len(spheres)] = data.geom_xpos[spheres] - (0.0, 0.0, CONTACT_RADIUS)
        places[k, len(spheres) :] = data.geom_xpos[others] + np.einsum("gij,gj->gi", R, middle)
        places[k, len(spheres) :, 2] -= np.einsum("gj,gj->g", np.abs(R[:, 2]), half)
    slides = _slower_side(np.abs(np.diff(places[:, :, 2], axis=0)) * clip.fps)
    speeds = _slower_side(np.linalg.norm(np.diff(places, axis=0), axis=2) * clip.fps)
    heights = places[:, :, 2]
    reach = np.full(heights.shape[1], _REACH)
    reach[len(FOOT_CONTACTS) : len(spheres)] = HAND_REACH
    rests = (heights < reach) & (speeds < _SLOW)
    skids = (heights < _LOW) & (slides < _LEVEL)
    return Contacts(heights, (heights < _CERTAIN) | rests | skids, rests)


def _slower_side(speeds: Array) -> Array:
    """Lower of the speeds before and after each of n frames: a sole rests before take-off, or after landing."""
    if len(speeds) == 0:
        return np.zeros((1, speeds.shape[1]))
    return np.minimum(np.vstack([speeds, speeds[-1:]]), np.vstack([speeds[:1], speeds]))
