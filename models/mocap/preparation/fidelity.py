"""Distance between a prepared clip and its capture, frame by frame over the part of the capture that was used."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import Array, rms
from geometry.quaternions import rotated
from models.humanoid.skeleton import JOINTS
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.motion.interpenetration import PARTS, depths
from models.mocap.preparation.bounds import MAX_ADDED_DEPTH, exceeding_text
from models.mocap.preparation.looping import LoopedClip
from models.mocap.preparation.poses import resampled

# Largest RMS distances of the joints, for a gait and for another motion [rad], and of the root [m]. In a prototype of
# the preparation, joints changed by 1.7 to 3° in gaits and by 7 to 8° in fighting and a punch, roots by 2.3 to 6.6 cm.
MAX_GAIT_JOINT_DISTANCE, MAX_JOINT_DISTANCE, MAX_ROOT_DISTANCE = np.deg2rad(3.0), np.deg2rad(8.0), 0.05
# Distance from the root of the points to its left that determine its heading [m], an arm's length. Half or twice the
# value changes the distances of the roots by at most 0.8 cm in the 28 captures of docs/validation/prepared-captures.md.
_HEADING_LEVER = 0.7
_Y_AXIS = np.array([0.0, 1.0, 0.0])
_LISTED_COUNT = 5  # number of joints in `Fidelity.extremes`
# Extent of a capture's path, relative to its clip's, below which a gait was captured in place: at most 0.11 in nine
# gaits from web pages, 0.96 to 1.03 in another and in those of docs/validation/prepared-captures.md.
_MAX_EXTENT_RATIO = 0.25
_MIN_GAIT_TRAVEL = 0.4  # displacement of a lap beyond which a closed clip that does not turn over is a gait [m]


class WorstJoint(NamedTuple):
    """Where a joint differs most.

    Attributes
    ----------
    joint : str
        Name of the joint.
    angle : float
        Angle between its rotations in clip and capture [rad].
    when : float
        Time in the clip [s].
    """

    joint: str
    angle: float
    when: float

    def line(self) -> str:
        """The measure in words."""
        return f"{self.joint} {np.rad2deg(self.angle):.0f}° at {self.when:.2f} s"


class Intrusion(NamedTuple):
    """Where one part of the body is deepest in another.

    Attributes
    ----------
    parts : tuple of (str, str)
        One of `models.mocap.motion.interpenetration.PARTS`.
    depth, captured : float
        How far they would have to be moved apart in the clip, and in the capture [m].
    when : float
        Time in the clip [s].
    """

    parts: tuple[str, str]
    depth: float
    captured: float
    when: float


class Fidelity(NamedTuple):
    """Distance of a clip from its capture.

    Attributes
    ----------
    joints : float
        RMS over joints and time of the angle between their rotations [rad].
    root : float
        RMS distance of the roots [m], after the displacement of the body over the floor that fits best. Of a gait that
        was captured in place, as on a treadmill, the uniform travel that it was given back does not count.
    extremes : tuple of WorstJoint
        The five joints that differ most, the largest first.
    gait : bool
        Whether the clip is a gait, for which the bound is tighter.
    intrusions : tuple of Intrusion
        Parts of the body that are deeper in each other than in the capture by more than `MAX_ADDED_DEPTH`.
    """

    joints: float
    root: float
    extremes: tuple[WorstJoint, ...]
    gait: bool
    intrusions: tuple[Intrusion, ...]

    def faults(self) -> tuple[str, ...]:
        """Measures that exceed their bounds, a line each."""
        found: list[str] = []
        if self.joints > (bound := MAX_GAIT_JOINT_DISTANCE if self.gait else MAX_JOINT_DISTANCE):
            far, most = exceeding_text(np.rad2deg(self.joints), np.rad2deg(bound)), f"{np.rad2deg(bound):.0f}"
            found.append(f"joints are {far}° RMS from the capture; {most} at most")
        if self.root > MAX_ROOT_DISTANCE:
            far = exceeding_text(100 * self.root, 100 * MAX_ROOT_DISTANCE)
            found.append(f"the root is {far} cm RMS from the capture; {100 * MAX_ROOT_DISTANCE:.0f} at most")
        for (first, second), depth, captured, when in self.intrusions:
            deep = f"the {first} goes {100 * depth:.1f} cm into the {second} at {when:.2f} s"
            found.append(f"{deep}, {100 * captured:.1f} in the capture; {100 * MAX_ADDED_DEPTH:.0f} more at most")
        return tuple(found)

    def line(self) -> str:
        """The measures in words, with the joint that differs most."""
        return (
            f"from the capture joints are {np.rad2deg(self.joints):.1f}°, the root {100 * self.root:.1f} cm RMS; "
            f"at most {self.extremes[0].line()}"
        )


def fidelity(clip: Clip, captured: Clip, part: LoopedClip, pace: float) -> Fidelity:
    """Compare a prepared clip with the calibrated capture.

    Frames that the capture does not have (the mirror image of half a stride, the way back of a gesture, the transitions
    from and to rest of an open clip) are not compared.

    Parameters
    ----------
    clip : Clip
        The prepared clip.
    captured : Clip
        The calibrated capture, before loop, filter and dynamics.
    part : LoopedClip
        The part of the paced capture from which the clip was made.
    pace : float
        Playback speed of the clip, relative to the capture's.
    """
    original = resampled(Clip(captured.poses, captured.fps * pace, captured.name), clip.fps)
    clip_frames, capture_frames = common_frames(clip, captured, part, pace)
    clip_poses, capture_poses = clip.poses[clip_frames], original.poses[capture_frames]
    gait = (
        clip.closes() and not clip.turns_over
        and bool(np.hypot(clip.displacement.x, clip.displacement.y) > _MIN_GAIT_TRAVEL)
    )  # fmt: skip
    over_floor = _root_distances(clip_poses, capture_poses, gait)
    height = capture_poses[:, 2] - clip_poses[:, 2]
    angles = np.linalg.norm(pose_difference(clip_poses, capture_poses)[:, 6:].reshape(len(clip_poses), -1, 3), axis=2)
    instants = (clip_frames.start + angles.argmax(axis=0)) / clip.fps
    largest = np.argsort(-angles.max(axis=0))[:_LISTED_COUNT]
    return Fidelity(
        rms(angles), rms(np.hypot(over_floor, height)),
        tuple(WorstJoint(JOINTS[k], float(angles[:, k].max()), float(instants[k])) for k in largest),
        gait,
        _intrusions(clip, captured),
    )  # fmt: skip


def _intrusions(clip: Clip, captured: Clip) -> tuple[Intrusion, ...]:
    """Parts that are deeper in each other in the whole clip than anywhere in the capture, by more than the bound."""
    found, most = depths(clip.poses), depths(captured.poses).max(axis=0)
    rows = zip(
        PARTS, found.max(axis=0).tolist(), most.tolist(), (found.argmax(axis=0) / clip.fps).tolist(), strict=True
    )
    return tuple(Intrusion(*row) for row in rows if row[1] > row[2] + MAX_ADDED_DEPTH)


def _root_distances(clip_poses: Array, capture_poses: Array, gait: bool) -> Array:
    """Distances of two roots over the floor after the best displacement of one of them [m], from poses (n, 75).

    The displacement, a rotation about the vertical and a translation, minimises the distances of the roots and of
    points to the left of them. For a body that stays in place, the path alone would not determine the heading. The
    paths of a gait that was captured in place are compared without their mean velocities.
    """
    extents = [float(np.hypot(*np.ptp(poses[:, :2], axis=0))) for poses in (clip_poses, capture_poses)]
    degree, frames = int(gait and extents[1] < _MAX_EXTENT_RATIO * extents[0]), np.arange(len(clip_poses))
    places, left = [], []
    for poses in (clip_poses, capture_poses):
        place = poses[:, :2] @ (1, 1j)
        places.append(place - np.polyval(np.polyfit(frames, place, degree), frames))
        left.append(_HEADING_LEVER * (rotated(poses[:, 3:7], _Y_AXIS)[:, :2] @ (1, 1j)))
    (a, b), (c, d) = places, left
    turn = np.exp(-1j * np.angle(np.sum(a.conj() * b + c.conj() * d)))
    return np.abs(b * turn - a)


def common_frames(clip: Clip, captured: Clip, part: LoopedClip, pace: float) -> tuple[slice, slice]:
    """Frames of a prepared clip, and of the paced capture at the clip's rate, that show the same moments.

    Moments that the capture does not have are in neither. The parameters are those of `fidelity`.
    """
    first, last = round(part.start * clip.fps), round(part.end * clip.fps)
    begin, frames = max(first, 0), int(captured.duration / pace * clip.fps + 1e-9) + 1
    n = min(clip.n_frames - begin + first, frames - begin, last - begin + 1)
    return slice(begin - first, begin - first + n), slice(begin, begin + n)
