"""Retargeting of a motion from any human skeleton to the figure.

Segment axes in the rig, the vertical and the floor are estimated from the motion itself (`calibration`, `upright`,
`footing`), never from the rig's rest pose, so limbs point exactly where the source's do. The root is the middle of the
hips, scaled by the length of the legs (`leg_proportions` for legs of other proportions). A constant vertical shift puts
the feet on the floor, so flights remain parabolas.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from geometry import quaternions
from geometry.arrays import Array, Mask
from geometry.physics import GRAVITY
from models.humanoid.skeleton import SEGMENTS, figure_model
from models.mocap.motion.clip import Clip
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.abdomen import with_abdomen
from models.mocap.retargeting.arm_twist import with_twist_shared
from models.mocap.retargeting.body_checks import check_biped, check_sides
from models.mocap.retargeting.body_lines import BodyLines, body_lines
from models.mocap.retargeting.broken_frames import repair_frames
from models.mocap.retargeting.calibration import Calibration, calibrate
from models.mocap.retargeting.calibration_pose import calibration_pose_length
from models.mocap.retargeting.footing import levelled, put_on_floor
from models.mocap.retargeting.hints import Hints
from models.mocap.retargeting.leg_proportions import hips_over_feet, rise_of_a_standing_foot
from models.mocap.retargeting.noise import without_noise
from models.mocap.retargeting.repeated_frames import without_repeated_frames
from models.mocap.retargeting.restarted_paths import with_path_carried_on
from models.mocap.retargeting.retarget_report import (
    RetargetReport,
    axis_name,
    beyond_range_remarks,
    calibration_remarks,
    endless_limb_remarks,
    frame_remarks,
    in_place_remarks,
    joint_jump_remarks,
    leap_remarks,
    leg_speed_remarks,
    padding_remarks,
    smoothing_remarks,
    stretch_remarks,
    unit_name,
)
from models.mocap.retargeting.skeleton_roles import Roles, joints_below, missing, unused
from models.mocap.retargeting.slow_steps import slow_step_remarks
from models.mocap.retargeting.straight_bones import check_bones
from models.mocap.retargeting.upright import unsupported_time, up_axis

_X, _Z = np.eye(3)[[0, 2]]
_NO_HINTS = Hints()
_PROPPED_REMARK = (
    "for {:.1f} s the body's weight is above neither its feet nor any other low part: what it sits, hangs or leans on "
    "is not in the file, and the figure lacks it, unless feet are missing or the file plays slower than recorded"
)
_SLOPE_REMARK = "the floor slopes by {:.1f}°: the motion is turned so that it is level"
_SITTING_REMARK = (
    "thighs and shanks are of another proportion than the figure's: between standing and sitting the hips are moved by "
    "{} cm in height, so that feet that stand stay on the floor"
)
# Largest difference of the legs' lengths, scaled to the figure, and height of one standing foot above the other, that
# are not reported [m]: a higher foot does not stand (`models.mocap.dynamics.contacts`). The first is at most 0.025 in
# 210 files, and 0.087 in the one it is from; the second at most 0.042 in 195 of 201 files, and 0.067 to 0.16 in four
# whose hips are 3 to 5 times as wide as the figure's.
_MAX_LEG_DIFFERENCE = 0.045
_UNEQUAL_REMARK = (
    "the {} leg is {:.0f} cm longer than the other, scaled to the figure, whose legs are equal: one foot is above the "
    "floor where both stand in the file; check the file"
)
_RAISED_REMARK = (
    "hips, thighs or shanks are of another proportion than the figure's: of two feet that stand flat in the file, one "
    "is up to {:.0f} cm above the other"
)


class _Frames(NamedTuple):
    """Frames of the file from `first` on: global rotations and positions of the joints, and anatomical positions.

    `dropped` is the number of leading frames of the file that do not belong to the motion: a calibration pose.
    """

    rotations: Array
    positions: Array
    lines: BodyLines
    first: int
    dropped: int


class _Body(NamedTuple):
    """The body with the figure's limbs above a level floor.

    `path`, `legs` and `hip_to_ankle` are the middle of the hips, the vectors from hips to ankles, and from the middle
    of the hips to the ankles, scaled, before the hips are moved in height, at most by `hip_shift`, and the floor's
    `slope` is levelled. Of two feet that stand in the file, one is above the other by `rise` at most.
    """

    root: Array
    segments: Array
    path: Array
    legs: Array
    hip_to_ankle: Array
    hip_shift: float
    rise: float
    slope: float


def retarget(motion: SourceMotion, roles: Roles, hints: Hints = _NO_HINTS) -> tuple[Clip, RetargetReport]:
    """The motion on the figure, starting above the world's origin and facing +x, and how it was interpreted.

    Raises
    ------
    MotionFileError
        If the skeleton's legs or hips have no extent, the file moves joints by positions instead of rotations, or
        estimates from the motion contradict each other.
    """
    rest = hints.rest_frame
    _check_channels(motion, rest)
    motion, repeated = without_repeated_frames(motion)
    repairs = with_path_carried_on(repair_frames(motion, roles, rest), roles)
    motion, noise = without_noise(repairs.motion, roles, repairs.jumps)
    frames = _frames(motion, roles, rest)
    repairs = repairs.since(frames.dropped)
    lines, skipped = frames.lines, frames.dropped - frames.first
    check_bones(motion, roles, frames.positions)
    positions = frames.positions[:, joints_below(roles.segments["pelvis"], motion.parents)]
    check_biped(motion, lines)
    up = up_axis(motion, roles, lines, positions, hints.up)
    check_sides(motion, lines)
    roles = with_abdomen(roles, lines, frames.positions)
    calibrated = _calibrate_body(motion, roles, frames, up.axis, rest)
    axes = _world_axes(calibrated.segments[skipped, 0], up.axis)
    figure_leg = _figure_leg_length(not np.isnan(lines.ankles).any())
    scale = figure_leg / lines.leg
    body = _scaled_body(lines, calibrated.segments, skipped, axes, scale, motion.fps)
    filled = lines.padding(motion.fps)[skipped:]
    counted = ~filled & _in_long_pieces([k - frames.dropped for k in repairs.jumps], len(filled))
    on_floor = put_on_floor(body.root, body.segments, motion.fps, counted)
    clip = Clip(_poses(*on_floor), motion.fps, motion.path.stem)
    propped = unsupported_time(lines, positions, up.axis, motion.fps, GRAVITY / scale)
    remarks = (
        *frame_remarks(repairs.frames, repairs.jumps, repairs.shortened, motion.fps, motion.timed),
        *leap_remarks(repairs.leaps, motion.fps),
        *smoothing_remarks(repeated[frames.dropped :], noise),
        *padding_remarks(filled, motion.fps, frames.dropped),
        *_step_remarks(body, figure_leg, motion.fps),
        *joint_jump_remarks(repairs.joints, motion),
        *_support_remarks(body, scale * lines.leg_difference, propped),
        *beyond_range_remarks(clip.poses),
        *endless_limb_remarks(lines, calibrated, roles),
        *stretch_remarks(lines),
        *(calibration_remarks(calibrated, lines, roles, len(filled)) if rest is None else ()),
    )
    report = RetargetReport(
        {body: motion.joints[joint] for body, joint in roles.segments.items()},
        unused(roles, motion.joints),
        missing(roles),
        axis_name(up.axis),
        axis_name(quaternions.rotated(quaternions.conjugate(axes), _X)),
        unit_name(motion.unit, lines.leg, figure_leg),
        scale,
        frames.dropped,
        up.lead,
        remarks,
    )
    return clip, report


def _scaled_body(lines: BodyLines, segments: Array, skipped: int, axes: Array, scale: float, fps: float) -> _Body:
    """The body from the frame `skipped` on, its legs scaled to the figure's, in the world, above a level floor."""
    segments = quaternions.product(axes, with_twist_shared(segments[skipped:]))
    hips, ankles = lines.middle[skipped:], lines.ankles[skipped:]
    path = scale * quaternions.rotated(axes, hips - hips[0])
    legs = scale * quaternions.rotated(axes, ankles - lines.hips[skipped:])
    hip_to_ankle = scale * quaternions.rotated(axes, ankles - hips[:, None])
    root = hips_over_feet(path, segments, legs, hip_to_ankle, fps)
    hip_shift = float(np.ptp(root[:, 2] - path[:, 2]))
    rise = rise_of_a_standing_foot(path, segments, hip_to_ankle, fps)
    root, segments, slope = levelled(root, segments, fps)
    if slope:  # levelling changes the heading of a body that does not face along the slope
        facing = _world_axes(segments[0, 0], _Z)
        root, segments = quaternions.rotated(facing, root), quaternions.product(facing, segments)
    return _Body(root, segments, path, legs, hip_to_ankle, hip_shift, rise, slope)


def _step_remarks(body: _Body, figure_leg: float, fps: float) -> Iterator[str]:
    """Legs that are too fast, steps that are too slow, and steps that do not carry the body along."""
    yield from leg_speed_remarks(body.legs, fps)
    yield from slow_step_remarks(body.path, body.legs, body.hip_to_ankle, figure_leg, fps)
    yield from in_place_remarks(body.path, body.hip_to_ankle, fps)


def _support_remarks(body: _Body, leg_difference: float, propped: float) -> Iterator[str]:
    """A levelled floor, legs of other proportions, and a time [s] in which the body is propped up by something.

    Where the left leg is longer than the right one by `leg_difference` [m], a foot that stands may count as in the air.
    """
    if body.slope:
        yield _SLOPE_REMARK.format(np.rad2deg(body.slope))
    if abs(leg_difference) > _MAX_LEG_DIFFERENCE:
        yield _UNEQUAL_REMARK.format("left" if leg_difference > 0.0 else "right", 100.0 * abs(leg_difference))
    elif body.rise > _MAX_LEG_DIFFERENCE:
        yield _RAISED_REMARK.format(100.0 * body.rise)
    elif body.hip_shift:
        yield _SITTING_REMARK.format(round(100.0 * body.hip_shift))
    if propped:
        yield _PROPPED_REMARK.format(propped)


def _in_long_pieces(jumps: list[int], n_frames: int) -> Mask:
    """Which frames are in a piece between jumps that is half as long as the longest, or longer."""
    lengths = np.diff([0, *(k + 1 for k in jumps), n_frames])
    return np.repeat(2 * lengths >= lengths.max(), lengths)


def _check_channels(motion: SourceMotion, rest: int | None) -> None:
    """Raise if joints are moved by positions alone, or the file does not have the frame `rest`."""
    if (
        np.all(motion.rotations == motion.rotations[0, 0])
        and np.ptp(motion.translations[:, 1:], axis=0).max(initial=0) > 0
    ):
        raise MotionFileError(motion.path, 0, "joints are moved by positions alone", "rotation channels")
    if rest is not None and rest >= motion.n_frames:
        raise MotionFileError(motion.path, 0, f"there is no frame {rest}", f"--rest-frame below {motion.n_frames}")


def _frames(motion: SourceMotion, roles: Roles, rest: int | None) -> _Frames:
    """The frames of the motion, without a leading calibration pose unless the user states it as the rest frame."""
    rotations = motion.global_rotations()
    positions = motion.global_positions(rotations)
    lines = body_lines(motion, roles, positions, rotations)
    dropped = calibration_pose_length(motion, roles, lines)
    first = 0 if rest is not None and rest < dropped else dropped
    if first:
        rotations, positions = rotations[first:], positions[first:]
        lines = body_lines(motion, roles, positions, rotations)
    return _Frames(rotations, positions, lines, first, dropped)


def _calibrate_body(motion: SourceMotion, roles: Roles, frames: _Frames, up: Array, rest: int | None) -> Calibration:
    """The body on the figure's segments, or an error if its joints do not define them."""
    unclear = MotionFileError(
        motion.path, 0, "its joints give the body no orientation", "a trunk, thighs and shanks that have a length"
    )
    frame = None if rest is None else rest - frames.first
    try:
        with np.errstate(invalid="ignore"):
            calibration = calibrate(roles, motion.parents, frames.lines, frames.rotations, up, motion.fps, frame)
    except np.linalg.LinAlgError:
        raise unclear from None
    if not np.isfinite(calibration.segments).all():
        raise unclear
    return calibration


def _world_axes(body: Array, up: Array) -> Array:
    """Rotation from the file's axes to the world's: `up` to z, the body's heading (its head's, if it lies) to +x.

    If the belly points downwards, it is the longer of the two: in a crawl the belly turns to the side with each limb.
    """
    forward, head = quaternions.rotated(body, _X), quaternions.rotated(body, _Z)
    x, head_heading = forward - up * (forward @ up), head - up * (head @ up)
    if np.linalg.norm(x) < max(0.3, float(np.linalg.norm(head_heading)) * (forward @ up < 0.0)):  # it lies, or crawls
        x = head_heading
    x /= np.linalg.norm(x)
    axes = Rotation.from_matrix(np.column_stack((x, np.cross(up, x), up)))
    return quaternions.conjugate(np.asarray(axes.as_quat(scalar_first=True)))


def _figure_leg_length(ankles: bool) -> float:
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
