"""Several people in one file: the joints of their hips, and extraction of the motion of one of them."""

from collections.abc import Sequence

import numpy as np

from geometry.arrays import Array
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.skeleton_roles import ancestry, has_legs, joints_below

# Largest distance between the hips of one body's two skeletons (such as a rig and its copy for deformation) over the
# length of their longest bone: copies in a file of five digits are 1e-4 apart, people at least a hip width (a half).
_MAX_COPY_DISTANCE = 0.1


def people_hips(motion: SourceMotion) -> tuple[tuple[int, ...], ...]:
    """Hips of each person in a file: the joints at which a left and a right leg meet.

    Skeletons whose hips stay at the same place, such as control rigs, belong to one person: their hips are one tuple.
    """
    found = _find_hips(motion.joints, motion.parents)
    if len(found) < 2:
        return tuple((hips,) for hips in found)
    places = motion.global_positions(motion.global_rotations())
    people: list[list[int]] = []
    for hips in found:
        own = [copies for copies in people if not _are_apart(places, hips, copies[0], motion.parents)]
        if own:
            own[0].append(hips)
        else:
            people.append([hips])
    return tuple(tuple(copies) for copies in people)


def extract_body(motion: SourceMotion, found: Sequence[int], joint: int) -> SourceMotion:
    """A motion with only the body that a joint belongs to; the joints of the other bodies are dropped.

    Parameters
    ----------
    motion : SourceMotion
    found : sequence of int
        Hips of its bodies.
    joint : int
        Any joint of the body that is kept.
    """
    others = [body for body in (_body_joints(hips, found, motion.parents) for hips in found) if joint not in body]
    dropped = set[int]().union(*others)
    return motion.of_joints([k for k in range(len(motion.joints)) if k not in dropped])


def _find_hips(joints: tuple[str, ...], parents: tuple[int, ...]) -> tuple[int, ...]:
    """The lowest joints that have both legs below them, in the file's order."""
    found: list[int] = []
    above_hips = set[int]()  # joints that are above hips
    sizes = np.ones(len(joints), dtype=int)
    for joint in reversed(range(len(joints))):
        if parents[joint] >= 0:
            sizes[parents[joint]] += sizes[joint]
    forks = np.bincount([parent for joint, parent in enumerate(parents) if parent >= 0 and sizes[joint] > 1],
                        minlength=len(joints)) > 1  # fmt: skip
    for joint in reversed(np.flatnonzero(forks).tolist()):
        if joint not in above_hips and has_legs(joint, joints, parents):
            found.append(joint)
            above_hips.update(ancestry(joint, parents))
    return tuple(sorted(found))


def _are_apart(places: Array, hips: int, other: int, parents: tuple[int, ...]) -> bool:
    """Whether two hips are at any time further apart than those of one body can be."""
    below = [k for k in joints_below(other, parents) if k != other]
    bones = np.linalg.norm(places[0, below] - places[0, [parents[k] for k in below]], axis=1)
    distance = np.linalg.norm(places[:, hips] - places[:, other], axis=1).max()
    return bool(distance > _MAX_COPY_DISTANCE * bones.max())


def _body_joints(hips: int, found: Sequence[int], parents: tuple[int, ...]) -> list[int]:
    """Joints below the highest joint that has no other hips below it."""
    shared = set[int]().union(*(ancestry(other, parents) for other in found if other != hips))
    return joints_below([k for k in ancestry(hips, parents) if k not in shared][-1], parents)
