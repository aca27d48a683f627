"""Distance of a prepared clip from the capture that it was made of, moment by moment of the part that was used."""

from typing import NamedTuple

import numpy as np

from models.arrays import Array
from models.humanoid.skeleton import JOINTS
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.motion.quaternions import rotated
from models.mocap.preparation.bounds import beyond
from models.mocap.preparation.looping import Looped
from models.mocap.preparation.poses import resampled

# Largest RMS distances of joints of a gait and of another motion [rad], and of the root [m]: in a prototype of the
# preparation gaits moved by 1.7 to 3°, fighting and a punch by 7 to 8°, roots by 2.3 to 6.6 cm.
GAIT, OTHERWISE, ROOT = np.deg2rad(3.0), np.deg2rad(8.0), 0.05
# Distance of the points to the left of a root that fix its heading [m], an arm's length: half or twice moves the roots
# of the 28 captures of docs/validation/prepared-captures.md by 0.8 cm at most.
_LEFT = 0.7
_Y = np.array([0.0, 1.0, 0.0])
_LISTED = 5  # joints listed
_TRAVELS = 0.4  # way of a lap beyond which a closed clip that does not turn over is a gait [m]


class Extreme(NamedTuple):
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


class Fidelity(NamedTuple):
    """Distance of a clip from its capture.

    Attributes
    ----------
    joints : float
        RMS over joints and time of the angle between their rotations [rad].
    root : float
        RMS distance of the roots [m], over the floor after the best displacement of the body on it.
    extremes : tuple of Extreme
        The five joints that differ most, the largest first.
    gait : bool
        Whether the clip is a gait, of which less change is accepted.
    """

    joints: float
    root: float
    extremes: tuple[Extreme, ...]
    gait: bool

    def faults(self) -> tuple[str, ...]:
        """Measures that exceed their bounds, a line each."""
        found: list[str] = []
        if self.joints > (bound := GAIT if self.gait else OTHERWISE):
            far, most = beyond(np.rad2deg(self.joints), np.rad2deg(bound)), f"{np.rad2deg(bound):.0f}"
            found.append(f"joints are {far}° RMS from the capture; {most} at most")
        if self.root > ROOT:
            far = beyond(100 * self.root, 100 * ROOT)
            found.append(f"the root is {far} cm RMS from the capture; {100 * ROOT:.0f} at most")
        return tuple(found)

    def line(self) -> str:
        """The measures in words."""
        far = ", ".join(f"{e.joint} {np.rad2deg(e.angle):.0f}° at {e.when:.2f} s" for e in self.extremes)
        return (
            f"from the capture joints are {np.rad2deg(self.joints):.1f}°, the root {100 * self.root:.1f} cm RMS; "
            f"at most {far}"
        )


def fidelity(clip: Clip, captured: Clip, part: Looped, pace: float) -> Fidelity:
    """Compare a prepared clip with the calibrated capture.

    Frames that the capture does not have (the mirror image of half a stride, the way back of a gesture, the way to and
    from rest of an open clip) are not compared.

    Parameters
    ----------
    clip : Clip
        The prepared clip.
    captured : Clip
        The calibrated capture, before loop, filter and dynamics.
    part : Looped
        The part of the paced capture from which the clip was made.
    pace : float
        How many times as fast as captured the clip is played.
    """
    original = resampled(Clip(captured.poses, captured.fps * pace, captured.name), clip.fps)
    shown, shows = common_frames(clip, captured, part, pace)
    ours, theirs = clip.poses[shown], original.poses[shows]
    level = _apart(ours, theirs)
    height = theirs[:, 2] - ours[:, 2]
    angles = np.linalg.norm(pose_difference(ours, theirs)[:, 6:].reshape(len(ours), -1, 3), axis=2)
    instants = (shown.start + angles.argmax(axis=0)) / clip.fps
    most = np.argsort(-angles.max(axis=0))[:_LISTED]
    return Fidelity(
        float(np.sqrt(np.mean(angles**2))), float(np.sqrt(np.mean(level**2 + height**2))),
        tuple(Extreme(JOINTS[k], float(angles[:, k].max()), float(instants[k])) for k in most),
        clip.closes() and not clip.turns_over and bool(np.hypot(clip.displacement.x, clip.displacement.y) > _TRAVELS),
    )  # fmt: skip


def _apart(ours: Array, theirs: Array) -> Array:
    """Distances of two roots over the floor after the best displacement of one of them [m], from poses (n, 75).

    Its rotation about the vertical and its translation minimise the distances of the roots and of points to the left
    of them. The path alone of a body that stays about its place would be laid upon the other with the body turned away.
    """
    places, left = [], []
    for poses in (ours, theirs):
        place = poses[:, :2] @ (1, 1j)
        places.append(place - place.mean())
        left.append(_LEFT * (rotated(poses[:, 3:7], _Y)[:, :2] @ (1, 1j)))
    (a, b), (c, d) = places, left
    turn = np.exp(-1j * np.angle(np.sum(a.conj() * b + c.conj() * d)))
    return np.abs(b * turn - a)


def common_frames(clip: Clip, captured: Clip, part: Looped, pace: float) -> tuple[slice, slice]:
    """Frames of a prepared clip, and of the paced capture at the clip's rate, that show the same moments.

    Those that the capture does not have are in neither; parameters as of `fidelity`.
    """
    first, last = round(part.start * clip.fps), round(part.end * clip.fps)
    begin, frames = max(first, 0), int(captured.duration / pace * clip.fps + 1e-9) + 1
    n = min(clip.n_frames - begin + first, frames - begin, last - begin + 1)
    return slice(begin - first, begin - first + n), slice(begin, begin + n)
