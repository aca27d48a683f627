"""Retargeting of a motion from any human skeleton to the figure.

Segment axes in the rig, the vertical and the floor are estimated from the motion itself (`calibration`, `upright`,
`footing`), never from the rig's rest pose, so limbs point exactly where the source's do. The root is the middle of the
hips, scaled by the length of the legs. A constant vertical shift puts the feet on the floor, so flights remain
parabolas.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from models.arrays import Array
from models.errors import ModelError
from models.humanoid.skeleton import JOINTS, SEGMENTS, figure_model
from models.mocap.motion import quaternions
from models.mocap.motion.clip import Clip
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.readers.motion_file import MotionFileError, printable
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.abdomen import with_abdomen
from models.mocap.retargeting.arm_twist import with_twist_shared
from models.mocap.retargeting.body_lines import SIDES, BodyLines, body_lines
from models.mocap.retargeting.broken_frames import repaired
from models.mocap.retargeting.calibration import calibrate
from models.mocap.retargeting.footing import levelled, on_the_floor
from models.mocap.retargeting.leading_pose import leading_frames
from models.mocap.retargeting.skeleton_roles import Roles, joints_below, missing, unused
from models.mocap.retargeting.straight_bones import check_bones
from models.mocap.retargeting.upright import AXES, check_sides, check_stature, up_axis

_X, _Z = np.eye(3)[[0, 2]]
_BENT = np.deg2rad(60.0)  # if the body never stands straighter than this, its spine cannot be calibrated well
_STANCE_FRAMES = 8  # least frames that tell a sole: by fewer, it lies up to 25° otherwise on legs 0.6 to 1.6 as long
_NAMED = 12  # unused joints that are named: rigs with faces and fingers have hundreds
_RANGE = np.deg2rad(15.0)  # least excess over joint ranges that is reported: their SD is 5 to 9° (Boone & Azen 1979)
COARSE = 10.0  # [1/s] frame rate below which a remark is made: motion is captured at 24 frames a second and more
_UNITS = (
    ("metres", 1.0),
    ("centimetres", 0.01),
    ("millimetres", 0.001),
    ("inches", 0.0254),
    ("inches / 0.45", 0.05644),
)


@dataclass(frozen=True)
class Hints:
    """Facts about a file that the user states in place of estimates.

    Parameters
    ----------
    up : str or None
        The file's axis that points up, such as ``+Y``.
    rest_frame : int or None
        A frame of the file in which the body stands upright with level feet, counted from 0.
    roles : Path or None
        A file that says which joint plays which role, in place of the joints' names; see `role_file`.

    Raises
    ------
    ModelError
        If there is no such axis, or the frame is negative.
    """

    up: str | None = None
    rest_frame: int | None = None
    roles: Path | None = None

    def __post_init__(self) -> None:
        if self.up is not None and self.up not in AXES:
            raise ModelError(f"no axis {self.up!r}; expected one of {', '.join(AXES)}")
        if self.rest_frame is not None and self.rest_frame < 0:
            raise ModelError(f"rest frame is {self.rest_frame}; expected a frame of the file, counted from 0")


_NO_HINTS = Hints()


class RetargetReport(NamedTuple):
    """How a motion file was interpreted.

    Attributes
    ----------
    taken : dict from figure body to source joint
        The joint that moves each segment.
    unused : tuple of str
        Source joints that move no segment.
    missing : tuple of str
        Segments without a joint, and which segment they follow.
    up : str
        The file's axis that points up, such as ``+Y``.
    facing : str
        The file's axis nearest to the body's first heading.
    unit : str
        The file's unit of length, estimated from the legs unless the format defines it.
    scale : float
        Metres of the figure per unit of the file.
    dropped : int
        Number of frames of a calibration pose in front, such as a T-pose, that are left out.
    confidence : float
        Lead of the score of `up` over the next axis, at least 0.25; infinite where the format or the user states it.
    remarks : tuple of str
        What could not be determined, and what was assumed instead.
    """

    taken: dict[str, str]
    unused: tuple[str, ...]
    missing: tuple[str, ...]
    up: str
    facing: str
    unit: str
    scale: float
    dropped: int = 0
    confidence: float = np.inf
    remarks: tuple[str, ...] = ()

    def lines(self) -> tuple[str, ...]:
        """The report in words, a line per subject."""
        how = "the format or you said so" if np.isinf(self.confidence) else f"confidence {self.confidence:.2f}"
        named = ", ".join(self.unused[:_NAMED])
        lines = (
            f"axes: up is {self.up} ({how}), the body faces {self.facing} at first",
            f"unit: {self.unit}; one unit becomes {self.scale:.5g} m, by the length of the legs",
            "taken: " + ", ".join(f"{joint} as {body}" for body, joint in self.taken.items()),
            "unused: " + (named or "none") + (f", … ({len(self.unused)} joints)" if len(self.unused) > _NAMED else ""),
            *([] if self.missing else ["missing: none"]),
        )
        return (*(printable(line, 4000) for line in lines), *self.notes())

    def notes(self) -> tuple[str, ...]:
        """What the file lacks, and what was left out, assumed or repaired, a line each."""
        frames = "frame" if self.dropped == 1 else f"{self.dropped} frames"
        lines = (
            *(["missing: " + ", ".join(self.missing)] if self.missing else []),
            *([f"left out: the first {frames}, a pose that is not of the motion"] if self.dropped else []),
            *self.remarks,
        )
        return tuple(printable(line, 4000) for line in lines)


def retarget(motion: SourceMotion, roles: Roles, hints: Hints = _NO_HINTS) -> tuple[Clip, RetargetReport]:
    """The motion on the figure, starting over the world's origin and facing +x, and how it was interpreted.

    Raises
    ------
    MotionFileError
        If the skeleton's legs or hips have no extent, the file moves joints by positions instead of rotations, or
        estimates from the motion contradict each other.
    """
    if (
        np.all(motion.rotations == motion.rotations[0, 0])
        and np.ptp(motion.translations[:, 1:], axis=0).max(initial=0) > 0
    ):
        raise MotionFileError(motion.path, 0, "joints are moved by positions alone", "rotation channels")
    rest = hints.rest_frame
    if rest is not None and rest >= motion.n_frames:
        raise MotionFileError(motion.path, 0, f"there is no frame {rest}", f"--rest-frame below {motion.n_frames}")
    motion, broken, jumps = repaired(motion, roles)
    rotations = motion.global_rotations()
    positions = motion.global_positions(rotations)
    lines = body_lines(motion, roles, positions, rotations)
    dropped = leading_frames(motion, roles, lines)
    # The pose in front is no part of the motion, but the user may name it as the rest frame.
    first = 0 if rest is not None and rest < dropped else dropped
    skipped = dropped - first
    if first:
        rotations, positions = rotations[first:], positions[first:]
        lines = body_lines(motion, roles, positions, rotations)
    check_bones(motion, roles, positions)
    body = joints_below(roles.segments["pelvis"], motion.parents)
    up = up_axis(motion, roles, lines, positions[:, body], hints.up)
    check_stature(motion, lines, up.axis)
    check_sides(motion, lines)
    roles = with_abdomen(roles, lines, positions)
    frame = None if rest is None else rest - first
    unclear = MotionFileError(
        motion.path, 0, "its joints do not tell how the body stands", "a trunk, thighs and shanks that have a length"
    )
    try:
        with np.errstate(invalid="ignore"):
            calibrated = calibrate(roles, motion.parents, lines, rotations, up.axis, motion.fps, frame)
    except np.linalg.LinAlgError:
        raise unclear from None
    if not np.isfinite(calibrated.segments).all():
        raise unclear
    axes = _world_axes(calibrated.segments[skipped, 0], up.axis)
    segments = quaternions.product(axes, with_twist_shared(calibrated.segments[skipped:]))
    own_leg = _own_leg(not np.isnan(lines.ankles).any())
    hips = lines.middle[skipped:]
    root = own_leg / lines.leg * quaternions.rotated(axes, hips - hips[0])
    root, segments, slope = levelled(root, segments, motion.fps)
    if slope:  # levelling changes the heading of a body that does not face along the slope
        ahead = _world_axes(segments[0, 0], _Z)
        root, segments = quaternions.rotated(ahead, root), quaternions.product(ahead, segments)
    clip = Clip(_poses(*on_the_floor(root, segments, motion.fps)), motion.fps, motion.path.stem)
    kept = [[k for k in told if k >= dropped] for told in (broken, jumps)]
    remarks = list(_named_frames(kept[0], kept[1], motion.fps, motion.timed))
    if slope:
        remarks.append(f"the floor slopes by {np.rad2deg(slope):.1f}°: the motion is turned so that it is level")
    if beyond := _named_beyond_ranges(clip.poses):
        remarks.append(beyond)
    if endless := _named_endless(lines, roles):
        remarks.append(endless)
    if rest is None and (guessed := _named_soles(calibrated.stances, roles, motion.n_frames - dropped)):
        remarks.append(guessed)
    if calibrated.bend > _BENT and rest is None:
        remarks.append("the body never stands straight: how its spine is at rest is a guess; --rest-frame would say it")
    report = RetargetReport(
        {body: motion.joints[joint] for body, joint in roles.segments.items()},
        unused(roles, motion.joints),
        missing(roles),
        _axis_name(up.axis),
        _axis_name(quaternions.rotated(quaternions.conjugate(axes), _X)),
        _unit_name(motion.unit, lines.leg, own_leg),
        own_leg / lines.leg,
        dropped,
        up.confidence,
        tuple(remarks),
    )
    return clip, report


def _world_axes(body: Array, up: Array) -> Array:
    """Rotation from the file's axes to the world's: `up` to z, the body's heading (its head's, if it lies) to +x."""
    forward, head = quaternions.rotated(body, _X), quaternions.rotated(body, _Z)
    x = forward - up * (forward @ up)
    if np.linalg.norm(x) < 0.3:
        x = head - up * (head @ up)
    x /= np.linalg.norm(x)
    turned = Rotation.from_matrix(np.column_stack((x, np.cross(up, x), up)))
    return quaternions.conjugate(np.asarray(turned.as_quat(scalar_first=True)))


def _own_leg(ankles: bool) -> float:
    """Length of the figure's leg [m] from hip to ankle, or to the knee if the source has no ankles."""
    model = figure_model()
    children = ("left_shank", "left_foot") if ankles else ("left_shank",)
    return sum(float(np.linalg.norm(model.body(child).pos)) for child in children)


def _poses(root: Array, segments: Array) -> Array:
    """MuJoCo's qpos from the root's positions and the segments' global rotations, shape (frames, 75)."""
    local = segments.copy()
    parents = [segment.parent for segment in SEGMENTS[1:]]
    local[:, 1:] = quaternions.product(quaternions.conjugate(segments[:, parents]), segments[:, 1:])
    return np.hstack((root, local.reshape(len(root), -1)))


def _named_beyond_ranges(poses: Array) -> str:
    """Remark on joints that exceed their ranges by more than people's ranges differ; empty if there is none."""
    excess = beyond_ranges(poses)
    most = excess.max(axis=0)
    told = [
        f"{JOINTS[k].replace('_', ' ')} by {np.rad2deg(most[k]):.0f}° ({np.mean(excess[:, k] > _RANGE):.0%} of frames)"
        for k in np.argsort(-most)
        if most[k] > _RANGE
    ]
    return f"beyond the figure's range: {', '.join(told)}; see whether the file has it so" if told else ""


def _named_soles(stances: Sequence[int], roles: Roles, n: int) -> str:
    """Remark on soles whose orientation a few frames tell; empty if there is none."""
    few = [
        f"the {side} one in {count or 'no'} frame{'s' * (count != 1)}"
        for side, count in zip(SIDES, stances, strict=True)
        if count < min(_STANCE_FRAMES, n) and f"{side}_foot" in roles.segments
    ]
    told = "how the soles lie is a guess, since they hardly stand level"
    return f"{told} ({', '.join(few)}); --rest-frame would say it" if few else ""


def _named_endless(lines: BodyLines, roles: Roles) -> str:
    """Remark on limbs of which neither a joint nor a tip says where they end; empty if there is none."""
    ends = {"upper_arm": lines.elbows, "forearm": lines.wrists, "shank": lines.ankles}
    named = [f"{side}_{part}" for part in ends for k, side in enumerate(SIDES) if np.isnan(ends[part][:, k]).any()]
    without = [limb.replace("_", " ") for limb in named if limb in roles.segments]
    return f"nothing tells where {', '.join(without)} end: how they point is a guess" if without else ""


def _named_frames(broken: Sequence[int], jumps: Sequence[int], fps: float, timed: bool) -> Iterator[str]:
    """Remarks on frames whose time is not stated or long, on those that were lost, and on jumps that are left."""
    if not timed:
        told = f"the file states no frame rate: {fps:g} a second are assumed"
        yield f"{told}; if it is another, convert it to BVH and correct its Frame Time"
    if fps < COARSE:
        yield f"a frame lasts {1.0 / fps:.2g} s, longer than a camera's: if that is not so, correct its Frame Time"
    if broken:
        n = len(broken)
        which = f"frame {broken[0]}" if n == 1 else f"{n} frames, the first of them frame {broken[0]},"
        yield f"{which} ({broken[0] / fps:.2f} s) did not belong to the motion around: interpolated"
    if jumps:
        times = ", ".join(f"{k / fps:.2f} s" for k in jumps[:8]) + (", …" if len(jumps) > 8 else "")
        yield f"the whole body jumps in a frame at {times}: what is lost there is too long to be interpolated"


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
