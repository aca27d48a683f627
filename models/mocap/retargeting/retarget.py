"""Carries a motion from any human skeleton to the figure, in closed form.

Every segment S of the figure takes the global rotation of its source joint J, both counted from rest:

    R_WS(t) = A G_J(t) B Q_S

G_J is the joint's rotation from the file's zero pose; B turns the figure's rest axes (forward, left, up) into the zero
pose's; A turns the file's axes into the world's (z up, facing +x at first). Q_S makes up for rest poses that differ
(T-pose, arms hanging, legs apart): the smallest turn, parent first, that lays the figure's bone at rest along the
source's. So arms and legs point exactly where the source's do. The root is the middle of the hips, scaled by the length
of the legs; one vertical shift sets the feet on the floor, so flights keep their parabolas.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from models.humanoid.skeleton import BODIES, SEGMENTS, figure_model
from models.mocap import quaternions
from models.mocap.clip import Clip
from models.mocap.readers.motion_file import MotionFileError, printable
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.footing import on_the_floor
from models.mocap.retargeting.skeleton_roles import Roles, missing, unused

Array = npt.NDArray[np.float64]

_X, _Y, _Z = np.eye(3)
_UPRIGHT = 0.4  # mean of the body's direction along the vertical, below which the motion does not tell what is up
_FLAT_FOOT = np.deg2rad(20)  # slope of the bone from ankle to toes in a foot that stands flat
_UNITS = (
    ("metres", 1.0),
    ("centimetres", 0.01),
    ("millimetres", 0.001),
    ("inches", 0.0254),
    ("inches / 0.45", 0.05644),
)


class RetargetReport(NamedTuple):
    """What a motion was taken for.

    Attributes
    ----------
    taken : dict from figure body to source joint
        The joint that moves each segment.
    unused : tuple of str
        Source joints that move nothing.
    missing : tuple of str
        Segments without a joint, and what they follow.
    up : str
        The file's axis that points up, such as ``+Y``.
    facing : str
        The file's axis nearest to where the zero pose faces.
    unit : str
        The file's unit of length, worked out from the legs unless the format tells it.
    scale : float
        Metres of the figure per unit of the file.
    """

    taken: dict[str, str]
    unused: tuple[str, ...]
    missing: tuple[str, ...]
    up: str
    facing: str
    unit: str
    scale: float

    def lines(self) -> tuple[str, ...]:
        """The report in words, a line per subject."""
        lines = (
            f"axes: up is {self.up}, the skeleton at rest faces {self.facing}",
            f"unit: {self.unit}; one unit becomes {self.scale:.5g} m, by the length of the legs",
            "taken: " + ", ".join(f"{joint} as {body}" for body, joint in self.taken.items()),
            "unused: " + (", ".join(self.unused) or "none"),
            "missing: " + (", ".join(self.missing) or "none"),
        )
        return tuple(printable(line, 4000) for line in lines)


def retarget(motion: SourceMotion, roles: Roles) -> tuple[Clip, RetargetReport]:
    """The motion on the figure, starting over the world's origin and facing +x, and what it was taken for.

    Raises
    ------
    MotionFileError
        If the skeleton's legs or hips have no extent, or the file moves joints by positions instead of rotations.
    """
    bones = motion.translations.mean(axis=0)
    if (
        np.all(motion.rotations == motion.rotations[0, 0])
        and np.ptp(motion.translations[:, 1:], axis=0).max(initial=0) > 0
    ):
        raise MotionFileError(motion.path, 0, "joints are moved by positions alone", "rotation channels")
    zero = _zero_pose(bones, motion.parents)
    rotations = motion.global_rotations()
    positions = motion.global_positions(rotations)
    rest = _rest_axes(zero, roles, motion)
    up = _vertical(positions, roles, rest)
    pelvis = rotations[0, roles.segments["pelvis"]]
    axes = _world_axes(quaternions.product(pelvis, rest), up)
    corrections = _corrections(zero, motion.tips, roles, rest)
    segments = _segment_rotations(rotations, roles, axes, rest, corrections)

    own_leg, leg = _leg_lengths(zero, roles, motion)
    hips = positions[:, [roles.segments["left_thigh"], roles.segments["right_thigh"]]].mean(axis=1)
    root = own_leg / leg * quaternions.rotated(axes, hips - hips[0])
    clip = Clip(_poses(*on_the_floor(root, segments, motion.fps)), motion.fps, motion.path.stem)
    report = RetargetReport(
        {body: motion.joints[joint] for body, joint in roles.segments.items()},
        unused(roles, motion.joints),
        missing(roles),
        _axis_name(up),
        _axis_name(quaternions.rotated(rest, _X)),
        _unit_name(motion.unit, leg, own_leg),
        own_leg / leg,
    )
    return clip, report


def _zero_pose(bones: Array, parents: tuple[int, ...]) -> Array:
    """Positions of the joints with all rotations zero, in the file's axes, shape (joints, 3)."""
    zero = np.array(bones)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            zero[joint] += zero[parent]
    return zero


def _quaternion(x: Array, y: Array, z: Array) -> Array:
    """The rotation that turns the coordinate axes into x, y, z (orthonormal)."""
    return np.asarray(Rotation.from_matrix(np.column_stack((x, y, z))).as_quat(scalar_first=True))


def _rest_axes(zero: Array, roles: Roles, motion: SourceMotion) -> Array:
    """B: the figure's rest axes (forward, left, up) → those of the zero pose in the file's axes."""
    left, right = zero[roles.segments["left_thigh"]], zero[roles.segments["right_thigh"]]
    knees = (zero[roles.segments["left_shank"]] + zero[roles.segments["right_shank"]]) / 2
    top = roles.segments.get("head", roles.segments.get("chest"))
    up = (left + right) / 2 - knees if top is None else zero[top] - (left + right) / 2
    y = left - right
    z = up - y * (up @ y) / max(y @ y, 1e-30)
    if min(np.linalg.norm(y), np.linalg.norm(z)) < 1e-9:
        raise MotionFileError(
            motion.path, 0, "hips and spine of the rest pose do not span a body", "offsets of a human"
        )
    y, z = y / np.linalg.norm(y), z / np.linalg.norm(z)
    frame = np.column_stack((np.cross(y, z), y, z))
    # Skeletons are modelled along the axes: a spine that leans a little at rest is its shape, not a turn.
    snapped = np.round(frame)
    if np.allclose(snapped @ snapped.T, np.eye(3)) and np.trace(snapped.T @ frame) > 1 + 2 * np.cos(np.deg2rad(20)):
        frame = snapped
    return _quaternion(*frame.T)


def _vertical(positions: Array, roles: Roles, rest: Array) -> Array:
    """The file's axis that points up: along which the head is above the ankles on the average of all frames.

    Where there is no such axis, for somebody rolls or lies, it is the rest pose's.
    """
    ends = [roles.ends.get(f"{side}_shank", roles.segments[f"{side}_shank"]) for side in ("left", "right")]
    top = roles.segments.get("head", roles.segments.get("chest", roles.segments["pelvis"]))
    body = positions[:, top] - positions[:, ends].mean(axis=1)
    mean = (body / np.maximum(np.linalg.norm(body, axis=1, keepdims=True), 1e-9)).mean(axis=0)
    if np.abs(mean).max() < _UPRIGHT:
        mean = quaternions.rotated(rest, _Z)
    axis = int(np.argmax(np.abs(mean)))
    return np.sign(mean[axis]) * np.eye(3)[axis]


def _world_axes(body: Array, up: Array) -> Array:
    """A: the file's axes → the world's, with `up` to z and the body's forward axis (its head's, when it lies) to +x."""
    forward, head = quaternions.rotated(body, _X), quaternions.rotated(body, _Z)
    x = forward - up * (forward @ up)
    if np.linalg.norm(x) < 0.3:
        x = head - up * (head @ up)
    x /= np.linalg.norm(x)
    return quaternions.conjugate(_quaternion(x, np.cross(up, x), up))


def _corrections(zero: Array, tips: Array, roles: Roles, rest: Array) -> dict[str, Array]:
    """Q_S of the limbs, in the figure's rest axes; identity for the trunk and for what has no direction."""
    corrections: dict[str, Array] = {}

    def direction(body: str) -> Array | None:
        start = roles.segments.get(body)
        end = roles.ends.get(body)
        if start is None:
            return None
        bone = (
            zero[end] + (tips[end] if body.endswith("foot") else 0.0) - zero[start] if end is not None else tips[start]
        )
        bone = quaternions.rotated(quaternions.conjugate(rest), bone)
        return bone if np.linalg.norm(bone) > 1e-9 else None

    for side, sign in (("left", 1.0), ("right", -1.0)):
        for chain, along in ((("upper_arm", "forearm"), sign * _Y), (("thigh", "shank"), -_Z)):
            q = np.array([1.0, 0.0, 0.0, 0.0])
            for part in chain:
                if (bone := direction(f"{side}_{part}")) is not None:
                    q = quaternions.product(quaternions.shortest_arc(quaternions.rotated(q, along), bone), q)
                corrections[f"{side}_{part}"] = q
        corrections[f"{side}_hand"] = corrections[f"{side}_forearm"]
        corrections[f"{side}_foot"] = _sole(
            quaternions.rotated(corrections[f"{side}_shank"], -_Z), direction(f"{side}_foot")
        )
    return corrections


def _sole(shank: Array, toes: Array | None) -> Array:
    """Q of a foot, from the directions of shank and toes at rest in the figure's axes.

    The foot stands flat at rest and looks where the toes do; it rolls with a leg that is spread at rest. The ankle lies
    above the toes, so the bone's slope is no rotation; a bone without slope is drawn along an axis, not from life.
    """
    spread = float(np.arctan2(shank[1], -shank[2]))
    roll = quaternions.about_axis(0, np.array(spread if abs(spread) > np.deg2rad(10) else 0.0))
    if toes is None:
        return roll
    x, y, z = quaternions.rotated(quaternions.conjugate(roll), toes) / np.linalg.norm(toes)
    if x < 0.5:
        return roll
    q = quaternions.product(roll, quaternions.about_axis(2, np.arctan2(y, x)))
    return quaternions.product(q, quaternions.about_axis(1, np.array(-_FLAT_FOOT))) if abs(z) < 0.08 else q


def _segment_rotations(
    rotations: Array, roles: Roles, axes: Array, rest: Array, corrections: dict[str, Array]
) -> Array:
    """R_WS of the 18 segments, shape (frames, 18, 4)."""
    segments = np.empty((len(rotations), len(SEGMENTS), 4))
    for index, segment in enumerate(SEGMENTS):
        joint = roles.segments.get(segment.body)
        if joint is None:
            segments[:, index] = segments[:, segment.parent]
            continue
        turned = quaternions.product(axes, quaternions.product(rotations[:, joint], rest))
        correction = corrections.get(segment.body)
        segments[:, index] = turned if correction is None else quaternions.product(turned, correction)
    if "abdomen" not in roles.segments:
        pelvis, abdomen, chest = (BODIES.index(body) for body in ("pelvis", "abdomen", "chest"))
        segments[:, abdomen] = quaternions.slerped(segments[:, pelvis], segments[:, chest], 0.5)
    return segments


def _leg_lengths(zero: Array, roles: Roles, motion: SourceMotion) -> tuple[float, float]:
    """Length of the figure's leg [m] and of the source's [its unit], hip to ankle, or to the knee where ankles lack."""
    bodies = ["thigh", "shank"] if {"left_shank", "right_shank"} <= roles.ends.keys() else ["thigh"]
    bones = [
        zero[roles.ends[f"{side}_{body}"]] - zero[roles.segments[f"{side}_{body}"]]
        for side in ("left", "right")
        for body in bodies
    ]
    leg = float(np.sum(np.linalg.norm(bones, axis=1))) / 2
    if leg < 1e-9:
        raise MotionFileError(motion.path, 0, "the legs have no length", "offsets of a human")
    model = figure_model()
    own = sum(float(np.linalg.norm(model.body(f"left_{child}").pos)) for child in ("shank", "foot")[: len(bodies)])
    return own, leg


def _poses(root: Array, segments: Array) -> Array:
    """MuJoCo's qpos from the root's positions and the segments' global rotations, shape (frames, 75)."""
    local = segments.copy()
    parents = [segment.parent for segment in SEGMENTS[1:]]
    local[:, 1:] = quaternions.product(quaternions.conjugate(segments[:, parents]), segments[:, 1:])
    return np.hstack((root, local.reshape(len(root), -1)))


def _axis_name(direction: Array) -> str:
    axis = int(np.argmax(np.abs(direction)))
    return f"{'+' if direction[axis] > 0 else '−'}{'XYZ'[axis]}"


def _unit_name(unit: float | None, leg: float, own_leg: float) -> str:
    """The unit in which the performer's legs are about as long as the figure's."""
    if unit is not None:
        return f"{unit:.5g} m (the format says so), legs {leg * unit:.2f} m"
    name, unit = min(_UNITS, key=lambda known: abs(np.log(leg * known[1] / own_leg)))
    likely = abs(np.log(leg * unit / own_leg)) < np.log(1.3)
    return f"{name} (worked out), legs {leg * unit:.2f} m" if likely else f"unknown, legs {leg:.4g} units"
