r"""Detection of a calibration pose in front of a motion, such as a T-pose in frame 0.

Between the pose and the motion is one step, v₀, that the motion does not go on with. A pose is told by either

- a step far larger than any step of the motion;
- zero rotations of all joints, as programs write the rig's rest pose: a motion that begins in it by itself goes on from
  it, :math:`|v_0 - v_1| \le |v_1|` from a uniform motion up to one of constant jerk;
- a body with straight legs and straight arms at least 30° off the trunk, alike on both sides, as T- and A-poses are,
  whose step is no part of the next ones: :math:`|v_0 - v_1| > 2 \max(|v_1|, |v_2|, |v_3|)`;
- zero rotations, or such a body, and first steps 1.5 times as large as the motion's, for at most 0.1 s: a filter or an
  interpolation has spread the one step;
- steps that fade within 0.1 s after such a jump, and are followed by calm: a filter has spread it, too;
- a first step by which a broken frame is told at the end, too (`broken_frames.begins_off`).

The jump is sought in the first quarter of a motion. Where a pose is held without any change, as no living body stands,
it is sought where that ends, however late; such a pose is told by its zero rotations or its straight limbs alone.

The second and third do not depend on how fast the motion is, nor on its frame rate. |v| is the RMS over the joints that
segments of the figure follow.
"""

import numpy as np

from models.arrays import Array, Mask
from models.mocap.motion import quaternions
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.body_lines import BodyLines, unit
from models.mocap.retargeting.broken_frames import FEWEST, begins_off, used_joints
from models.mocap.retargeting.skeleton_roles import Roles, ancestry

# Half or twice of each of these numbers finds no such pose in 17 captures, none of which has one.
_SHARE = 0.25  # largest share of a motion that may be such a pose, unless it is held without any change
_STILL = (
    1e-5  # largest step of a pose that does not change [rad], RMS over the joints: files have four decimals or more
)
_TIMES = 5.0  # least ratio of the jump to the 99th percentile of the steps
_TURN = np.deg2rad(5.0)  # least jump, RMS over the joints [rad]: no body turns so far in a frame
# Longest time over which the jump is spread [s], and least ratio of its steps to the 99th percentile: 0.04 and 1.6 to 8
# in three captures that were filtered. No body begins faster than it goes on.
_BLENDED, _FASTER = 0.1, 1.5
# Largest share of the first step of a jump that fades which the steps after it have, and least cosine between its
# steps: 0.96 and more in six captures. No motion begins by three such steps.
_CALM, _ALONG = 0.4, 0.9
_HELD = 0.1  # farthest that a pose which is held is from that before the jump, as a share of the jump
# Of a calibration pose: bend of its limbs, difference of its sides, least angle of its arms to the trunk's line and
# largest to the trunk's plane.
_STRAIGHT, _ALIKE = np.cos(np.deg2rad([20.0, 12.0]))
_OFF, _AHEAD = np.sin(np.deg2rad([30.0, 25.0]))


def leading_frames(motion: SourceMotion, roles: Roles, lines: BodyLines) -> int:
    """Number of frames in front of a motion that are a calibration pose."""
    used = used_joints(motion, roles)
    rotations = motion.rotations[:, used]
    if motion.n_frames < 4:
        return 0
    turns = _turns(rotations[:-1], rotations[1:])
    root = ancestry(roles.segments["pelvis"], motion.parents)
    at_rest = motion.at_rest([joint for joint in used if joint not in root])
    jumped = _faded(turns, _jumped(rotations, turns, at_rest, lines), round(_BLENDED * motion.fps))
    begun, ended = _spread(rotations, _size(turns), round(_BLENDED * motion.fps))
    soon = ended <= _SHARE * motion.n_frames or _stands(_size(turns)) == begun
    told = soon and (at_rest[: begun + 1].all() or _calibrating(lines))
    led = max(jumped, ended) if told else jumped
    return led or int(begins_off(motion, roles))


def _jumped(rotations: Array, turns: Array, at_rest: Mask, lines: BodyLines) -> int:
    """Number of frames before a jump from a calibration pose; 0 if there is none."""
    n = len(turns) + 1
    steps = _size(turns)
    share, stands = max(1, int(_SHARE * n)), _stands(steps)
    early = steps[: max(share, stands + 1)]
    if early.max() < _TURN:
        return 0
    if n >= FEWEST and stands < share:
        jump = int(np.argmax(early))
        usual = float(np.quantile(np.delete(steps, jump), 0.99))
        # The pose is held still; if there is motion before the jump, the jump is a fault of the capture.
        if _held(rotations, jump, steps[jump]) and steps[jump] >= _TIMES * usual:
            return jump + 1
    jump = int(np.argmax(early >= _TURN))
    if not _held(rotations, jump, steps[jump]) or jump + 1 >= n - 1:
        return 0
    leaves = float(_size(turns[jump] - turns[jump + 1]))
    as_zero = at_rest[: jump + 1].all() and not at_rest[jump + 1] and leaves > steps[jump + 1]
    as_posed = _calibrating(lines) and leaves > 2.0 * steps[jump + 1 : jump + 4].max()
    return jump + 1 if as_zero or as_posed else 0


def _faded(turns: Array, jumped: int, longest: int) -> int:
    """Number of frames before a motion whose jump from a pose a filter has spread.

    Its steps, all in one direction, fade, and then all is calm.
    """
    if not jumped:
        return 0
    turns, steps = turns[jumped:], _size(turns[jumped:])
    lasts = int(np.argmax(np.append(steps < _CALM * steps[0], True)))
    calm = steps[lasts : lasts + longest].max(initial=0.0) < _CALM * steps[0]
    along = np.sum(turns[: lasts - 1] * turns[1:lasts], axis=(1, 2)) / turns.shape[1]
    straight = (along > _ALONG * steps[: lasts - 1] * steps[1:lasts]).all() if lasts > 2 else False
    fades = straight and lasts <= longest and (np.diff(steps[:lasts]) < 0.0).all()
    return jumped + lasts if fades and calm and steps[:lasts].sum() > 3.0 * _TURN else jumped


def _stands(steps: Array) -> int:
    """The first step of a pose that changes; their number if none does."""
    return int(np.argmax(np.append(steps > _STILL, True)))


def _spread(rotations: Array, steps: Array, longest: int) -> tuple[int, int]:
    """From and to which step a pose is left by steps that are all larger than the motion's; 0 and 0 if none are."""
    if longest < 2 or len(steps) < max(FEWEST, 4 * longest):
        return 0, 0
    usual = float(np.quantile(np.sort(steps)[:-longest], 0.99))
    large = steps > _FASTER * usual
    begun = int(np.argmax(large))
    ended = begun + int(np.argmin(np.append(large[begun:], False)))
    burst = steps[begun:ended]
    told = len(burst) <= longest and burst.sum() > 3.0 * _TURN
    return (begun, ended) if told and _held(rotations, begun, burst.max()) else (0, 0)


def _size(turns: Array) -> Array:
    """RMS over the joints [rad] of rotation vectors of shape (..., joints, 3)."""
    return np.sqrt((turns**2).sum(axis=-1).mean(axis=-1))


def _turns(ours: Array, theirs: Array) -> Array:
    """Rotation vectors from rotations to others."""
    return quaternions.logarithm(quaternions.product(quaternions.conjugate(ours), theirs))


def _held(rotations: Array, last: int, jump: float) -> bool:
    """Whether the pose until a frame, after which it jumps, is held: slow motion is not, however small its steps."""
    return bool(_size(_turns(rotations[:last], rotations[last])).max(initial=0.0) < _HELD * jump)


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
