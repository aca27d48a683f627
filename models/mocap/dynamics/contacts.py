"""Contact detection: which parts of the body touch the floor, robust to errors of some centimetres in captures.

A part of the body that bears load is near the floor *and* at rest. Height alone does not suffice: the swinging feet of
runners clear the floor by less than a capture's standing feet may hover above it. Hands are supported by fingers, which
the figure lacks, so their height threshold is larger.

One rule, `standing_parts`, decides which feet of a motion stand, here and in `preparation`. Because of errors of leg
length, the feet of captured runners slide while they stand; a foot *rests* only where it stands and is slow. Whether a
part *touches* is decided more leniently, so that no flight is found where something may bear load.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from geometry.arrays import Array, Mask
from geometry.spans import cleaned
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, HAND_CONTACTS, figure_model
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip

# Height below which a part touches at any speed [m]. Half or twice the value changes whether the body is supported in
# 0.8 % of the frames of 17 captures.
_CONTACT_HEIGHT = 0.005
# Height above which it does not touch at any speed [m]: captured feet hover by 3 cm or more; hands lack fingers.
# Half or twice either value changes whether the body is supported in 0.1 % of the frames of 17 captures.
_MAX_CONTACT_HEIGHT, HAND_REACH = 0.06, 0.12
# Speed below which a palm rests [m/s]. With 0.55 the stances of the hands in LAFAN's fall from 36 s are shorter, and
# the physical figure falls.
_MAX_HAND_SPEED = 0.6
# Height [m] and speed [m/s] below which heel or toes stand. Chosen on eight captures with a prototype: ±1 cm and
# ±0.1 m/s change the residual of the prepared motions by less than 1 percentage point.
_MAX_STANCE_HEIGHT, _MAX_STANCE_SPEED = 0.045, 0.55
# Fraction of the root's speed below which they stand, too, but do not rest. If they rested, the soles of the embedded
# run that is led would slide by 3.8 cm instead of 2.4 cm.
_ROOT_SPEED_FRACTION = 0.3
# Half or twice any of the next four values changes whether a sphere stands in at most 0.9 % of the frames of 19
# captures (in one capture 9 %, if stances of up to 0.12 s are dropped).
_MAX_TOE_HEIGHT, _MAX_TOE_SPEED = 0.10, 0.15  # [m], [m/s]: of toes that stand beside a standing heel
MAX_FILLED_GAP, MIN_STANCE_TIME = 0.05, 0.06  # gaps shorter than this are filled, stances shorter than this dropped [s]
# A part below this height [m] and vertical speed [m/s] slides over the floor. Half the height changes whether the body
# is supported in 1.2 % of these frames, twice the height in 0.2 %; half or twice the speed in 0.6 %.
_MAX_SLIDING_HEIGHT, _MAX_VERTICAL_SPEED = 0.03, 0.25


class Contacts(NamedTuple):
    """Contacts of m parts of the body with the floor over n frames.

    Attributes
    ----------
    heights : array, shape (n, m)
        Heights of the parts' lowest points [m]: the feet's 8 contact spheres, the hands' 2, then all other geoms.
    touching : array of bool, shape (n, m)
        Whether a part is taken to bear load.
    resting : array of bool, shape (n, m)
        Whether it bears load at rest; a foot rests where it stands (`standing_parts`) and is slow.
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
        """Whether any part bears load, shape (n,)."""
        return np.any(self.touching, axis=1)

    @property
    def loaded(self) -> Mask:
        """Whether each foot bears load, left and right, shape (n, 2)."""
        return np.stack([self.touching[:, :4].any(axis=1), self.touching[:, 4:8].any(axis=1)], axis=1)

    @property
    def planted(self) -> Mask:
        """Whether each foot stands at rest, left and right, shape (n, 2)."""
        return np.stack([self.resting[:, :4].any(axis=1), self.resting[:, 4:8].any(axis=1)], axis=1)


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
        places[k, : len(spheres)] = data.geom_xpos[spheres]
        places[k, len(spheres) :] = data.geom_xpos[others] + np.einsum("gij,gj->gi", R, middle)
        places[k, len(spheres) :, 2] -= np.einsum("gj,gj->g", np.abs(R[:, 2]), half)
    heights, feet = places[:, :, 2].copy(), len(FOOT_CONTACTS)
    heights[:, : len(spheres)] -= CONTACT_RADIUS
    speeds = _lower_one_sided_speed(np.linalg.norm(np.diff(places, axis=0), axis=2) * clip.fps)
    vertical_speeds = _lower_one_sided_speed(np.abs(np.diff(heights, axis=0)) * clip.fps)
    max_heights = np.full(heights.shape[1], _MAX_CONTACT_HEIGHT)
    max_heights[feet : len(spheres)] = HAND_REACH
    max_speeds = np.full(heights.shape[1], _MAX_STANCE_SPEED)
    max_speeds[feet : len(spheres)] = _MAX_HAND_SPEED
    slow = (heights < max_heights) & (speeds < max_speeds)
    sliding = (heights < _MAX_SLIDING_HEIGHT) & (vertical_speeds < _MAX_VERTICAL_SPEED)
    resting = slow.copy()
    stance = standing_parts(places[:, :feet], clip.poses[:, :2], clip.fps, clip.closes(CLOSURE_TOLERANCE))
    resting[:, :feet] &= np.repeat(stance, 2, axis=2).reshape(-1, feet)
    return Contacts(heights, (heights < _CONTACT_HEIGHT) | slow | sliding, resting)


def standing_parts(soles: Array, root: Array, fps: float, closed: bool = False) -> Mask:
    """Whether heel and toes of each foot stand on the floor z = 0, shape (n, 2 feet, 2 parts).

    A part stands while its middle is lower than `_MAX_STANCE_HEIGHT`, and slower than `_MAX_STANCE_SPEED` or than
    `_ROOT_SPEED_FRACTION` of the root's speed. Toes stand beside a standing heel up to `_MAX_TOE_HEIGHT`, if they are
    slower than `_MAX_TOE_SPEED`. Gaps shorter than `MAX_FILLED_GAP` are filled, and stances shorter than
    `MIN_STANCE_TIME` dropped.

    Parameters
    ----------
    soles : array, shape (n, 8, 3)
        Centres of the contact spheres [m], in the order of `FOOT_CONTACTS`.
    root : array, shape (n, 2)
        Positions of the root over the floor [m].
    fps : float
        Frame rate [1/s].
    closed : bool
        Whether the last frame is the first of the next lap, so that a stance may continue across the seam.
    """
    middles = soles.reshape(len(soles), 2, 2, 2, 3).mean(axis=3)
    heights, speeds, pace = middles[..., 2] - CONTACT_RADIUS, np.zeros(middles.shape[:3]), np.zeros(len(soles))
    if len(soles) > 1:
        speeds = np.linalg.norm(np.gradient(middles, axis=0), axis=3) * fps
        pace = np.linalg.norm(np.gradient(root, axis=0), axis=1) * fps
    stance = (heights < _MAX_STANCE_HEIGHT) & (
        speeds < np.maximum(_MAX_STANCE_SPEED, _ROOT_SPEED_FRACTION * pace)[:, None, None]
    )
    stance[:, :, 1] |= stance[:, :, 0] & (heights[:, :, 1] < _MAX_TOE_HEIGHT) & (speeds[:, :, 1] < _MAX_TOE_SPEED)
    for foot in range(2):
        for part in range(2):
            stance[:, foot, part] = cleaned(
                stance[:, foot, part], round(MAX_FILLED_GAP * fps), round(MIN_STANCE_TIME * fps), closed
            )
    return stance


def _lower_one_sided_speed(speeds: Array) -> Array:
    """The lower of the speeds before and after each of n frames: a sole rests before take-off, or after landing."""
    if len(speeds) == 0:
        return np.zeros((1, speeds.shape[1]))
    return np.minimum(np.vstack([speeds, speeds[-1:]]), np.vstack([speeds[:1], speeds]))
