"""Anatomical joint positions of a captured body in every frame, and the lines between them.

Everything here comes from joint positions during the motion, so it does not depend on how a rig is set up: on its rest
pose, its joint frames, or extra joints in between.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from models.arrays import Array, Mask
from models.mocap.motion import quaternions
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.skeleton_roles import Roles

SIDES = ("left", "right")
AT_REST = 0.3  # speed up to which a joint is at rest [leg lengths/s]: a walker's swinging foot has 3
_UNMOVED = 1e-6  # step of a joint that does not move, by rounding [leg lengths]: files have four decimals or more
_FILLED = 0.5  # least time for which nothing moves of a motion that is filled up [s]: no living body stands so still
# Shares of a motion's usual step between which it is under way where it is held: 0.2 to 1.7 in motions that are filled
# up, below 0.08 in those that end at rest, above 6 in those that end in another pose.
_UNDER_WAY = (0.15, 3.0)
_TOES = np.sin(np.deg2rad(30.0))  # least median sine of toes to the shank: 50 to 90° off it in captures


class BodyLines(NamedTuple):
    """A body in n frames, in the file's axes and unit.

    Attributes
    ----------
    hips, knees, ankles, shoulders, elbows, wrists, toes : array of shape (n, 2, 3)
        Joints, left and right; NaN where the skeleton has none.
    top : array of shape (n, 3)
        Upper end of the trunk: the middle of the shoulders, or of what there is instead (head, chest).
    has_arms : bool
        Whether `top` is the middle of the shoulders.
    leg : float
        Length of thigh and shank, mean of both sides and median over time; of the thigh alone where ankles lack.
    """

    hips: Array
    knees: Array
    ankles: Array
    shoulders: Array
    elbows: Array
    wrists: Array
    toes: Array
    top: Array
    has_arms: bool
    leg: float

    @property
    def middle(self) -> Array:
        """Middle of the hips, shape (n, 3)."""
        return self.hips.mean(axis=1)

    @property
    def left(self) -> Array:
        """From the right hip to the left one, shape (n, 3)."""
        return self.hips[:, 0] - self.hips[:, 1]

    @property
    def trunk(self) -> Array:
        """From the hips to the top, shape (n, 3)."""
        return self.top - self.middle

    @property
    def lowest_joints(self) -> Array:
        """Ankles, or knees where the skeleton ends there, shape (n, 2, 3)."""
        return np.where(np.isnan(self.ankles), self.knees, self.ankles)

    def knee_normals(self) -> Array:
        """Thigh × shank, both of unit length: along the body's left when a knee is bent, shape (n, 2, 3)."""
        return np.cross(unit(self.knees - self.hips), unit(self.ankles - self.knees))

    def elbow_normals(self) -> Array:
        """Upper arm × forearm, both of unit length, shape (n, 2, 3)."""
        return np.cross(unit(self.elbows - self.shoulders), unit(self.wrists - self.elbows))

    def filled(self, fps: float) -> Mask:
        """Frames that fill a motion up at its ends, without the one that is held, shape (n,).

        Nothing moves in them, for `_FILLED` at least, though the motion is under way: a body that has come to rest, or
        jumps into another pose, tells something.
        """
        parts = (self.hips, self.knees, self.ankles, self.toes, self.shoulders, self.elbows, self.wrists)
        paths = np.concatenate([part for part in parts if not np.isnan(part).any()], axis=1)
        steps = np.linalg.norm(np.diff(paths, axis=0), axis=2).mean(axis=1)
        moves = np.flatnonzero(steps >= _UNMOVED * self.leg)
        result = np.zeros(len(steps) + 1, dtype=np.bool_)
        if len(moves):
            first, last = int(moves[0]), int(moves[-1]) + 1  # the held frame in front, and that after the end
            slow, fast = np.multiply(_UNDER_WAY, np.median(steps[moves]))
            result[:first] = first > _FILLED * fps and slow < steps[first] < fast
            result[last + 1 :] = len(steps) - last > _FILLED * fps and slow < steps[last - 1] < fast
        return result


def unit(vectors: Array) -> Array:
    """Unit vectors along vectors of shape (..., 3); NaN where the length is 0."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0.0, length, np.nan)


def body_lines(motion: SourceMotion, roles: Roles, positions: Array, rotations: Array) -> BodyLines:
    """The lines of a body from the global positions (n, joints, 3) and rotations (n, joints, 4) of its joints.

    Raises
    ------
    MotionFileError
        If hips and trunk have no extent, or the legs no length.
    """
    nowhere = np.full((len(positions), 3), np.nan)

    def paired(part: str, end: bool = False) -> Array:
        table = roles.ends if end else roles.segments
        names = [f"{side}_{part}" for side in SIDES]
        return np.stack([positions[:, table[name]] if name in table else nowhere for name in names], axis=1)

    def either(part: str, child: str, chosen: Callable[[list[Array], int], Array] = lambda tips, k: tips[0]) -> Array:
        """Positions at which a segment ends: its end joint, or else the joint of the next segment, or its own tip."""
        end = paired(part, end=True)
        end = np.where(np.isnan(end), paired(child), end)
        for k, side in enumerate(SIDES):
            joint = roles.segments.get(f"{side}_{part}")
            if joint is not None and np.isnan(end[:, k]).any() and np.any(motion.tips[joint]):
                tips = [motion.tips[joint], *motion.further_tips.get(joint, ())]
                end[:, k] = chosen([positions[:, joint] + quaternions.rotated(rotations[:, joint], t) for t in tips], k)
        return end

    shoulders = paired("upper_arm")
    has_arms = not np.isnan(shoulders).any()
    other = roles.segments.get("head", roles.segments.get("chest"))
    hips, knees, ankles = paired("thigh"), either("thigh", "shank"), either("shank", "foot")
    if has_arms:
        top = shoulders.mean(axis=1)
    elif other is not None:
        top = positions[:, other]
    else:
        # Legs alone: the trunk is taken to continue the thighs.
        top = hips.mean(axis=1) + (hips - knees).mean(axis=1)
    toes = either("foot", "toe", lambda tips, k: _foremost(tips, hips[:, k], knees[:, k], ankles[:, k]))
    for k in range(len(SIDES)):
        # What just continues the shank, as programs make up tips, points nowhere.
        if not np.median(_sine(toes[:, k] - ankles[:, k], ankles[:, k] - knees[:, k])) > _TOES:
            toes[:, k] = np.nan
    parts = [np.linalg.norm(knees - hips, axis=2)]
    if not np.isnan(ankles).any():
        parts.append(np.linalg.norm(ankles - knees, axis=2))
    leg = float(np.median(np.sum(parts, axis=0).mean(axis=1)))
    lines = BodyLines(hips, knees, ankles, shoulders, either("upper_arm", "forearm"), either("forearm", "hand"), toes,
                      top, has_arms, leg)  # fmt: skip
    extent = (lines.leg, *(float(np.median(np.linalg.norm(v, axis=1))) for v in (lines.left, lines.trunk)))
    if extent[0] < 1e-9:
        raise MotionFileError(motion.path, 0, "the legs have no length", "offsets of a human")
    if min(extent) < 1e-3 * extent[0] or np.median(_sine(lines.left, lines.trunk)) < 0.3:
        raise MotionFileError(motion.path, 0, "hips and spine do not span a body", "offsets of a human")
    return lines


def _foremost(tips: list[Array], hip: Array, knee: Array, ankle: Array) -> Array:
    """Of the ends of a foot, such as its heel and its toes, that towards which the knee bends; all of shape (n, 3)."""
    left = np.cross(knee - hip, ankle - knee)
    ahead = np.cross(left, hip - ankle)
    return max(tips, key=lambda tip: float(np.median(np.sum((tip - ankle) * ahead, axis=1))))


def _sine(a: Array, b: Array) -> Array:
    return np.linalg.norm(np.cross(unit(a), unit(b)), axis=1)
