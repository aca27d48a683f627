"""Anatomical joint positions of a captured body in every frame, and the lines between them.

Everything here comes from joint positions during the motion, so it does not depend on how a rig is set up: neither on
its rest pose, nor on its joint frames, nor on extra joints in between.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from geometry import quaternions
from geometry.arrays import Array, Mask
from geometry.quaternions import unit
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.skeleton_roles import Roles

SIDES = ("left", "right")
AT_REST = 0.3  # speed up to which a joint is at rest [leg lengths/s]: a walker's swinging foot has 3
_MAX_SWAY = 0.03  # largest movement of any joint of a body that holds a pose, relative to its hips [leg lengths]
_MAX_STILL_STEP = 1e-6  # step of a joint at rest, due to rounding [leg lengths]: files have four decimals or more
_MIN_PADDING_TIME = 0.5  # least time without any movement in padding [s]: no living body stands so still
# Step just before or after the padding over the motion's median step, between which the motion was cut while moving:
# 0.2 to 1.7 in padded motions, below 0.08 in those that end at rest, above 6 in those that end in another pose.
_MOVING_STEP_RATIOS = (0.15, 3.0)
_MIN_TOE_SINE = np.sin(np.deg2rad(30.0))  # least median sine between toes and shank: 50 to 90° in captures
# Mean turn of both feet to one side of where the hips face, above which the tips of feet without toe joints are not
# their toes: 9° at most in 20 captures of such rigs, 15° in 117 with toe joints but for one of style transfer.
_MAX_TIP_TURN = np.deg2rad(30.0)
# Least mean sine of toes and knees, and distance of the wrists ahead of the shoulders [leg lengths], that show where a
# body faces. Of 128 gestures before depth cameras, hands are 0.22 and more ahead in the 13 whose knees seem to bend
# back by 9 to 24°; in a walk of a mirrored body they are behind.
MIN_SIDE_EVIDENCE = 0.15


class BodyLines(NamedTuple):
    """A body in n frames, in the file's axes and unit.

    Attributes
    ----------
    hips, knees, ankles, shoulders, elbows, wrists, toes : array of shape (n, 2, 3)
        Joints, left and right; NaN if the skeleton does not have them.
    top : array of shape (n, 3)
        Upper end of the trunk: the middle of the shoulders or, without both arms, the head or the chest.
    has_arms : bool
        Whether `top` is the middle of the shoulders.
    leg : float
        Length of thigh and shank, mean of both sides and median over time; of the thigh alone without ankles.
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
    def leg_difference(self) -> float:
        """Length of the left leg less that of the right one, thigh and shank, median over time; NaN without ankles."""
        parts = np.linalg.norm(self.knees - self.hips, axis=2), np.linalg.norm(self.ankles - self.knees, axis=2)
        left, right = np.median(np.sum(parts, axis=0), axis=0)
        return float(left - right)

    @property
    def lowest_joints(self) -> Array:
        """Ankles, or knees where the skeleton ends there, shape (n, 2, 3)."""
        return np.where(np.isnan(self.ankles), self.knees, self.ankles)

    @property
    def is_single_pose(self) -> bool:
        """Whether the body holds one pose in all frames, up to the sway of somebody who stands."""
        parts = (self.knees, self.ankles, self.toes, self.shoulders, self.elbows, self.wrists)
        places = np.concatenate([part for part in parts if not np.isnan(part).any()], axis=1) - self.middle[:, None]
        return bool(np.ptp(places, axis=0).max() < _MAX_SWAY * self.leg)

    def knee_normals(self) -> Array:
        """Thigh × shank, both of unit length: along the body's left when a knee is bent, shape (n, 2, 3)."""
        return np.cross(unit(self.knees - self.hips), unit(self.ankles - self.knees))

    def elbow_normals(self) -> Array:
        """Upper arm × forearm, both of unit length, shape (n, 2, 3)."""
        return np.cross(unit(self.elbows - self.shoulders), unit(self.wrists - self.elbows))

    def padding(self, fps: float) -> Mask:
        """Padding: frames at the ends that repeat the motion's first or last frame, without that frame, shape (n,).

        Nothing moves in them, for at least `_MIN_PADDING_TIME`, although the motion was cut while moving. A body that
        has come to rest, or that jumps into another pose, is no padding.
        """
        parts = (self.hips, self.knees, self.ankles, self.toes, self.shoulders, self.elbows, self.wrists)
        paths = np.concatenate([part for part in parts if not np.isnan(part).any()], axis=1)
        steps = np.linalg.norm(np.diff(paths, axis=0), axis=2).mean(axis=1)
        moves = np.flatnonzero(steps >= _MAX_STILL_STEP * self.leg)
        result = np.zeros(len(steps) + 1, dtype=np.bool_)
        if len(moves):
            first, last = int(moves[0]), int(moves[-1]) + 1  # the frames that padding repeats, at start and end
            slow, fast = np.multiply(_MOVING_STEP_RATIOS, np.median(steps[moves]))
            result[:first] = first > _MIN_PADDING_TIME * fps and slow < steps[first] < fast
            result[last + 1 :] = len(steps) - last > _MIN_PADDING_TIME * fps and slow < steps[last - 1] < fast
        return result


def body_lines(motion: SourceMotion, roles: Roles, positions: Array, rotations: Array) -> BodyLines:
    """The lines of a body from the global positions (n, joints, 3) and rotations (n, joints, 4) of its joints.

    Raises
    ------
    MotionFileError
        If hips and trunk have no extent, or the legs no length.
    """
    missing = np.full((len(positions), 3), np.nan)

    def pair(part: str, end: bool = False) -> Array:
        table = roles.ends if end else roles.segments
        names = [f"{side}_{part}" for side in SIDES]
        return np.stack([positions[:, table[name]] if name in table else missing for name in names], axis=1)

    def ends_of(part: str, child: str, chosen: Callable[[list[Array], int], Array] = lambda tips, k: tips[0]) -> Array:
        """Positions at which a segment ends: its end joint, or else the joint of the next segment, or its own tip."""
        end = pair(part, end=True)
        end = np.where(np.isnan(end), pair(child), end)
        for k, side in enumerate(SIDES):
            joint = roles.segments.get(f"{side}_{part}")
            if joint is not None and np.isnan(end[:, k]).any() and np.any(motion.tips[joint]):
                tips = [motion.tips[joint], *motion.further_tips.get(joint, ())]
                end[:, k] = chosen([positions[:, joint] + quaternions.rotated(rotations[:, joint], t) for t in tips], k)
        return end

    substitute = roles.segments.get("head", roles.segments.get("chest"))
    hips, knees, ankles = pair("thigh"), ends_of("thigh", "shank"), ends_of("shank", "foot")
    shoulders = pair("upper_arm")
    has_arms = not np.isnan(shoulders).any()
    if has_arms:
        top = shoulders.mean(axis=1)
    elif substitute is not None:
        top = positions[:, substitute]
    else:
        # Legs alone: the trunk is taken to continue the thighs.
        top = hips.mean(axis=1) + (hips - knees).mean(axis=1)
    toes = ends_of("foot", "toe", lambda tips, k: _foremost(tips, hips[:, k], knees[:, k], ankles[:, k]))
    for k in range(len(SIDES)):
        # A tip that merely continues the shank, as programs invent them, gives no direction.
        if not np.median(_sine(toes[:, k] - ankles[:, k], ankles[:, k] - knees[:, k])) > _MIN_TOE_SINE:
            toes[:, k] = np.nan
    parts = [np.linalg.norm(knees - hips, axis=2)]
    if not np.isnan(ankles).any():
        parts.append(np.linalg.norm(ankles - knees, axis=2))
    leg = float(np.median(np.sum(parts, axis=0).mean(axis=1)))
    lines = BodyLines(hips, knees, ankles, shoulders, ends_of("upper_arm", "forearm"), ends_of("forearm", "hand"), toes,
                      top, has_arms, leg)  # fmt: skip
    _check_extent(lines, motion)
    if not {f"{side}_foot" for side in SIDES} & roles.ends.keys() and _tips_point_aside(lines):
        return lines._replace(toes=np.full_like(toes, np.nan))
    return lines


def _tips_point_aside(lines: BodyLines) -> bool:
    """Whether the ends of the feet are turned together to one side of where the hips face, or back.

    Programs invent such tips, along an axis of the file or to the heel. Feet may turn out or in, but opposite ways. In
    a mirrored body they point back, too, but so do its knees.
    """
    left, shank, foot = unit(lines.left)[:, None], unit(lines.knees - lines.ankles), unit(lines.toes - lines.ankles)
    ahead = unit(np.cross(left, shank))
    x, y = (np.sum(foot * axis, axis=2).mean() for axis in (ahead, np.cross(shank, ahead)))
    turn, bend = abs(np.arctan2(y, x)), np.sum(lines.knee_normals() * left, axis=2).mean()
    return bool(turn > _MAX_TIP_TURN and (turn < np.pi - _MAX_TIP_TURN or bend > MIN_SIDE_EVIDENCE))


def _check_extent(lines: BodyLines, motion: SourceMotion) -> None:
    """Raise if legs, hips or trunk have no extent, or hips and trunk are in line."""
    extent = (lines.leg, *(float(np.median(np.linalg.norm(v, axis=1))) for v in (lines.left, lines.trunk)))
    if extent[0] < 1e-9:
        raise MotionFileError(motion.path, 0, "the legs have no length", "offsets of a human")
    if min(extent) < 1e-3 * extent[0] or np.median(_sine(lines.left, lines.trunk)) < 0.3:
        raise MotionFileError(motion.path, 0, "hips and spine do not span a body", "offsets of a human")


def _foremost(tips: list[Array], hip: Array, knee: Array, ankle: Array) -> Array:
    """Of the ends of a foot (heel, toes), the one furthest in the direction of the knee's bend; all of shape (n, 3)."""
    left = np.cross(knee - hip, ankle - knee)
    ahead = np.cross(left, hip - ankle)
    return max(tips, key=lambda tip: float(np.median(np.sum((tip - ankle) * ahead, axis=1))))


def _sine(a: Array, b: Array) -> Array:
    return np.linalg.norm(np.cross(unit(a), unit(b)), axis=1)
