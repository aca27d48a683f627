r"""Detection of a calibration pose in front of a motion, such as a T-pose in frame 0.

Between the pose and the motion is one step, v₀, that the motion does not continue. A pose is recognised by any of

- a step far larger than any step of the motion;
- zero rotations of all joints, as programs write the rig's rest pose: a motion that really begins in it continues from
  it, :math:`|v_0 - v_1| \le |v_1|` from a uniform motion up to one of constant jerk;
- a body with straight legs and straight arms at least 30° off the trunk, as T- and A-poses are, whose step
  does not continue in the next ones: :math:`|v_0 - v_1| > 2 \max(|v_1|, |v_2|, |v_3|)`;
- zero rotations, or such a body, and first steps 1.5 times as large as the motion's, for at most 0.1 s: a filter or an
  interpolation has spread the one step; for at most 0.25 s, if the largest is 3 times as large as the motion's;
- a first step as large as that of a broken frame at the end of a motion (`broken_frames.first_step_jumps`).

The pose is held until the jump: it moves by less than a tenth of that.

The second and third criteria depend neither on the speed of the motion nor on its frame rate. |v| is the RMS over the
joints that segments of the figure follow.
"""

import numpy as np

from geometry import quaternions
from geometry.arrays import Array, Mask
from geometry.quaternions import unit
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.body_lines import BodyLines
from models.mocap.retargeting.broken_frames import MIN_FRAME_COUNT, first_step_jumps, used_joints
from models.mocap.retargeting.skeleton_roles import Roles, ancestry

# Half or twice any of these values finds no such pose in 17 captures, none of which has one.
_MIN_JUMP_RATIO = 5.0  # least ratio of the jump to the 99th percentile of the steps
_MIN_JUMP_ANGLE = np.deg2rad(5.0)  # least jump, RMS over the joints [rad]: no body turns so far in a frame
# Longest time over which the jump is spread [s], and least ratio of its steps to the 99th percentile: 0.04 and 1.6 to 8
# in three captures that were filtered. No body begins faster than it continues.
_MAX_BLEND_TIME, _MIN_BLEND_RATIO = 0.1, 1.5
# The same of a jump that is spread over more time: 0.2 s and 4 to 9 in five files at 25 a second.
_MAX_SLOW_BLEND_TIME, _MIN_SLOW_BLEND_RATIO = 0.25, 3.0
_MAX_HELD_RATIO = 0.1  # largest distance between a held pose and that before the jump, as a fraction of the jump
# Of a calibration pose: largest bend of the limbs, and least angle of the arms to the trunk's sagittal plane.
_MIN_STRAIGHT_COSINE, _MIN_OUTWARD_SINE = np.cos(np.deg2rad(20.0)), np.sin(np.deg2rad(30.0))


def calibration_pose_length(motion: SourceMotion, roles: Roles, lines: BodyLines) -> int:
    """Number of frames of a calibration pose in front of a motion."""
    used = used_joints(motion, roles)
    rotations = motion.rotations[:, used]
    if motion.n_frames < 4:
        return 0
    turns = _rotation_vectors(rotations[:-1], rotations[1:])
    root = ancestry(roles.segments["pelvis"], motion.parents)
    at_rest = motion.at_rest([joint for joint in used if joint not in root])
    jumped = _frames_before_jump(rotations, turns, at_rest, lines)
    begun, ended = _find_blend(rotations, turns, motion.fps)
    is_pose = at_rest[: begun + 1].all() or _is_calibration_pose(lines)
    frames = max(jumped, ended) if is_pose else jumped
    return frames or int(first_step_jumps(motion, roles))


def _frames_before_jump(rotations: Array, turns: Array, at_rest: Mask, lines: BodyLines) -> int:
    """Number of frames before a jump from a calibration pose; 0 if there is none."""
    n = len(turns) + 1
    steps = _rms_angle(turns)
    if steps.max() < _MIN_JUMP_ANGLE:
        return 0
    if n >= MIN_FRAME_COUNT:
        jump = int(np.argmax(steps))
        usual = float(np.quantile(np.delete(steps, jump), 0.99))
        # The pose must be held; if there is motion before the jump, the jump is a fault of the capture.
        if _is_held(rotations, jump, steps[jump]) and steps[jump] >= _MIN_JUMP_RATIO * usual:
            return jump + 1
    jump = int(np.argmax(steps >= _MIN_JUMP_ANGLE))
    if not _is_held(rotations, jump, steps[jump]) or jump + 1 >= n - 1:
        return 0
    departure = float(_rms_angle(turns[jump] - turns[jump + 1]))
    leaves_zero_pose = at_rest[: jump + 1].all() and not at_rest[jump + 1] and departure > steps[jump + 1]
    leaves_posed_body = _is_calibration_pose(lines) and departure > 2.0 * steps[jump + 1 : jump + 4].max()
    return jump + 1 if leaves_zero_pose or leaves_posed_body else 0


def _find_blend(rotations: Array, turns: Array, fps: float) -> tuple[int, int]:
    """First step, and the one after the last, of a jump by steps that are all larger than the motion's; else (0, 0)."""
    steps = _rms_angle(turns)
    for longest, ratio in (
        (round(_MAX_BLEND_TIME * fps), _MIN_BLEND_RATIO),
        (round(_MAX_SLOW_BLEND_TIME * fps), _MIN_SLOW_BLEND_RATIO),
    ):
        if longest < 2 or len(steps) < max(MIN_FRAME_COUNT, 4 * longest):
            continue
        usual = float(np.quantile(np.sort(steps)[:-longest], 0.99))
        large = steps > _MIN_BLEND_RATIO * usual
        begun = int(np.argmax(large))
        ended = begun + int(np.argmin(np.append(large[begun:], False)))
        burst = steps[begun:ended]
        is_jump = len(burst) <= longest and burst.sum() > 3.0 * _MIN_JUMP_ANGLE and burst.max() > ratio * usual
        if is_jump and _is_held(rotations, begun, burst.max()):
            return begun, ended
    return 0, 0


def _rms_angle(turns: Array) -> Array:
    """RMS over the joints [rad] of rotation vectors of shape (..., joints, 3)."""
    return np.sqrt((turns**2).sum(axis=-1).mean(axis=-1))


def _rotation_vectors(first: Array, second: Array) -> Array:
    """Rotation vectors [rad] from the first rotations to the second."""
    return quaternions.logarithm(quaternions.product(quaternions.conjugate(first), second))


def _is_held(rotations: Array, last: int, jump: float) -> bool:
    """Whether the pose is held until the frame after which it jumps; slow motion is not, however small its steps."""
    return bool(
        _rms_angle(_rotation_vectors(rotations[:last], rotations[last])).max(initial=0.0) < _MAX_HELD_RATIO * jump
    )


def _is_calibration_pose(lines: BodyLines) -> bool:
    """Whether the body is in a T- or A-pose in the first frame."""
    left, trunk = unit(lines.left[0]), unit(lines.trunk[0])
    upper, fore, thighs, shanks = (unit((end - start)[0]) for start, end in (
        (lines.shoulders, lines.elbows), (lines.elbows, lines.wrists), (lines.hips, lines.knees),
        (lines.knees, lines.ankles)))  # fmt: skip
    straight = np.concatenate((np.sum(upper * fore, axis=1), np.sum(thighs * shanks, axis=1), -(thighs @ trunk)))
    outwards = (upper @ left) * (1.0, -1.0)
    return bool((straight > _MIN_STRAIGHT_COSINE).all() and (outwards > _MIN_OUTWARD_SINE).all())
