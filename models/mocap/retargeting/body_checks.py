"""Checks that a body is a human's, and that its left and right are as named."""

from typing import NamedTuple

import numpy as np

from geometry.quaternions import unit
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.body_lines import MIN_SIDE_EVIDENCE, BodyLines

# Least length of an animal's trunk [leg lengths] (1.0 in two elephants, 1.2 to 1.4 in 12 dogs), and largest mean cosine
# between trunk and legs if it is across them: 0.16 in these, and 0.84 and more in ten human skeletons of another
# make, with trunks of 0.7 to 1.3.
_MIN_ANIMAL_TRUNK, _MAX_ANIMAL_COSINE = 0.8, 0.5


def check_biped(motion: SourceMotion, lines: BodyLines) -> None:
    """Refuse an animal with a human's joint names: its trunk is about as long as the legs, and across them throughout.

    Raises
    ------
    MotionFileError
        If the body is an animal's.
    """
    length = float(np.median(np.linalg.norm(lines.trunk, axis=1))) / lines.leg
    whole = lines.has_arms and not np.isnan(lines.ankles).any()
    legs = unit((lines.hips - lines.ankles).mean(axis=1))
    if (
        whole
        and length > _MIN_ANIMAL_TRUNK
        and float(np.sum(unit(lines.trunk) * legs, axis=1).mean()) < _MAX_ANIMAL_COSINE
    ):
        what = f"the trunk is {length:.1f} times as long as thigh and shank, and across the legs"
        raise MotionFileError(motion.path, 0, what, "a human, who stands at times")


def check_sides(motion: SourceMotion, lines: BodyLines) -> None:
    """Refuse a mirrored body: hips and trunk define left, which toes, the bend of the knees and the arms must confirm.

    Depth cameras see straight knees bend back: they alone show nothing if hands are held out to where the body faces.

    Raises
    ------
    MotionFileError
        If toes and knees show a mirrored body, if one of them does while the other is unclear or contradicts it, or if
        left and right of the shoulders are on average opposite to the hips': no trunk is twisted by more than 90°
        throughout.
    """
    evidence = side_evidence(lines)
    values = {"toes": evidence.toes, "knees": evidence.knees}
    ahead = [part for part, value in values.items() if value > MIN_SIDE_EVIDENCE]
    back = [part for part, value in values.items() if value < -MIN_SIDE_EVIDENCE]
    stated = "left and right as named, or --roles FILE"
    shoulders = lines.shoulders[:, 0] - lines.shoulders[:, 1]
    if lines.has_arms and np.sum(lines.left * shoulders) < 0.0:
        which = "legs" if len(back) > len(ahead) else "arms" if len(back) < len(ahead) else "arms or legs"
        what = f"left and right of the {which} are exchanged: shoulders and hips point opposite ways"
        raise MotionFileError(motion.path, 0, what, stated)
    if not back or ("toes" not in (*ahead, *back) and evidence.hands > MIN_SIDE_EVIDENCE):
        return
    if ahead:
        raise MotionFileError(
            motion.path, 0, "toes and knees point opposite ways", "a body that bends its knees forwards"
        )
    raise MotionFileError(motion.path, 0, f"the body is mirrored: {' and '.join(back)} point back", stated)


class SideEvidence(NamedTuple):
    """How far a body points to where it faces if left and right are as named; 0 for parts that it lacks.

    Attributes
    ----------
    toes, knees : float
        Mean sines by which toes and knees point ahead.
    elbows : float
        Mean sine by which elbows point back.
    hands : float
        Mean distance of the wrists ahead of the shoulders [leg lengths].
    """

    toes: float
    knees: float
    elbows: float
    hands: float


def side_evidence(lines: BodyLines) -> SideEvidence:
    """Evidence for the sides of a body."""
    left = unit(lines.left)
    # Ahead of each foot's own shank: in the world, the toes of a kneeling body point back.
    ahead = unit(np.cross(left[:, None], unit(lines.knees - lines.ankles)))
    toes = np.sum(unit(lines.toes - lines.ankles) * ahead, axis=2)
    knees, elbows = lines.knee_normals() @ left[:, :, None], -lines.elbow_normals() @ left[:, :, None]
    hands = np.sum((lines.wrists - lines.shoulders) * np.cross(left, unit(lines.trunk))[:, None], axis=2) / lines.leg
    parts = (toes, knees, elbows, hands)
    return SideEvidence(*(float(np.nanmean(part)) if np.isfinite(part).any() else 0.0 for part in parts))
