r"""Detection of a calibration pose in front of a motion, such as a T-pose in frame 0.

Between the pose and the motion is one step, v₀, that the motion does not go on with. A pose is told by either

- a step far larger than any step of the motion;
- zero rotations of all joints, as programs write the rig's rest pose: a motion that begins in it by itself goes on from
  it, :math:`|v_0 - v_1| \le |v_1|` from a uniform motion up to one of constant jerk;
- a body with straight legs and straight arms at least 30° off the trunk, alike on both sides, as T- and A-poses are,
  whose step is no part of the next ones: :math:`|v_0 - v_1| > 2 \max(|v_1|, |v_2|, |v_3|)`.

The second and third do not depend on how fast the motion is, nor on its frame rate. |v| is the RMS over the joints that
segments of the figure follow.
"""

import numpy as np

from models.arrays import Array
from models.mocap.motion import quaternions
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.body_lines import BodyLines, unit
from models.mocap.retargeting.broken_frames import FEWEST
from models.mocap.retargeting.skeleton_roles import Roles, ancestry

# Half or twice of each of these numbers finds no such pose in 17 captures, none of which has one.
_SHARE = 0.25  # largest share of a motion that may be such a pose, held
_TIMES = 5.0  # least ratio of the jump to the 99th percentile of the steps
_TURN = np.deg2rad(5.0)  # least jump, RMS over the joints [rad]: no body turns so far in a frame
_HELD = 0.1  # largest step while the pose is held, as a share of the jump
# Of a calibration pose: bend of its limbs, difference of its sides, least angle of its arms to the trunk's line and
# largest to the trunk's plane.
_STRAIGHT, _ALIKE = np.cos(np.deg2rad([20.0, 12.0]))
_OFF, _AHEAD = np.sin(np.deg2rad([30.0, 25.0]))


def leading_frames(motion: SourceMotion, roles: Roles, lines: BodyLines) -> int:
    """Number of frames in front of a motion that are a calibration pose."""
    n = motion.n_frames
    used = sorted({above for joint in roles.segments.values() for above in ancestry(joint, motion.parents)})
    rotations = motion.rotations[:, used]
    turns = quaternions.logarithm(quaternions.product(quaternions.conjugate(rotations[:-1]), rotations[1:]))
    steps = _size(turns)
    early = steps[: max(1, int(_SHARE * n))]
    if n < 4 or early.max() < _TURN:
        return 0
    if n >= FEWEST:
        jump = int(np.argmax(early))
        usual = float(np.quantile(np.delete(steps, jump), 0.99))
        # The pose is held still; if there is motion before the jump, the jump is a fault of the capture.
        if _held(steps, jump) and steps[jump] >= _TIMES * usual:
            return jump + 1
    jump = int(np.argmax(early >= _TURN))
    if not _held(steps, jump) or jump + 1 >= n - 1:
        return 0
    leaves = float(_size(turns[jump] - turns[jump + 1]))
    root = ancestry(roles.segments["pelvis"], motion.parents)
    at_rest = motion.at_rest([joint for joint in used if joint not in root])[: jump + 2]
    as_zero = at_rest[:-1].all() and not at_rest[-1] and leaves > steps[jump + 1]
    as_posed = _calibrating(lines) and leaves > 2.0 * steps[jump + 1 : jump + 4].max()
    return jump + 1 if as_zero or as_posed else 0


def _size(turns: Array) -> Array:
    """RMS over the joints [rad] of rotation vectors of shape (..., joints, 3)."""
    return np.sqrt((turns**2).sum(axis=-1).mean(axis=-1))


def _held(steps: Array, jump: int) -> bool:
    return bool(steps[:jump].max(initial=0.0) < _HELD * steps[jump])


def _calibrating(lines: BodyLines) -> bool:
    """Whether the body stands in the first frame as in a T- or A-pose."""
    left, trunk = unit(lines.left[0]), unit(lines.trunk[0])
    bones = [unit((end - start)[0]) for start, end in (
        (lines.shoulders, lines.elbows), (lines.elbows, lines.wrists), (lines.hips, lines.knees),
        (lines.knees, lines.ankles))]  # fmt: skip
    upper, fore, thighs, shanks = bones
    straight = np.concatenate((np.sum(upper * fore, axis=1), np.sum(thighs * shanks, axis=1), -(thighs @ trunk)))
    arms, legs = upper - 2.0 * np.outer(upper @ left, left), thighs - 2.0 * np.outer(thighs @ left, left)
    alike = np.array([arms[0] @ upper[1], legs[0] @ thighs[1]])  # each left limb's mirror image, and the right one
    outwards = (upper @ left) * (1.0, -1.0)
    ahead = np.abs(upper @ unit(np.cross(left, trunk)))
    return bool(
        (straight > _STRAIGHT).all() and (alike > _ALIKE).all() and (outwards > _OFF).all() and (ahead < _AHEAD).all()
    )
