"""Repair of lost frames of a capture: where a joint jumps away and, within a tenth of a second, jumps back.

At the end of a file, where it cannot jump back, one frame that jumps away is left out.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from geometry import quaternions
from geometry.arrays import Array, Mask
from models.mocap.readers.source_motion import MAX_GAP_TIME, SourceMotion
from models.mocap.retargeting.skeleton_roles import Roles, ancestry

# Least ratio of a gap's jumps to the 95th percentile of the joint's steps, and of a single frame's distance from the
# middle of its neighbours to the 95th percentile of such distances. In the captures of
# docs/validation/prepared-captures.md and the embedded clips, at their own rates and down to 15 Hz, joints that turn
# out and back by `_MIN_JUMP_ANGLE` have at most 4.9, except a hand in CMU 16_09, whose markers flip for a frame.
_MIN_JUMP_RATIO = 5.5
# Half or twice `MAX_GAP_TIME` or any of the next values changes none of the 17 captures of the tuning half, except
# that half of `_MIN_JUMP_ANGLE` changes one by 0.3° RMS.
_MIN_JUMP_ANGLE = np.deg2rad(15.0)  # least jump of a joint [rad]
_MIN_ROOT_JUMP = 0.25  # least jump of the root [thigh lengths]
_MAX_GAP_STEP_RATIO = 0.3  # largest step across a gap, as a fraction of the smaller jump
# At a turning point of a motion that is played forwards and backwards: least ratio of the step before it to the next
# one (0.31 to 0.9 in two captures), and largest distance between before and after, relative to the former.
_MIN_APPROACH_RATIO, _MAX_RETURN_RATIO = 0.3, 0.1
# Largest step of a joint, relative to one beside it, with which a limb moves on: more is another pose, as in a cut
# between two takes.
MAX_STEP_RATIO = 2.0
_MIN_JOINT_FRACTION = 0.25  # least fraction of the joints that jump at once if the whole pose jumps
MIN_FRAME_COUNT = 10  # least number of frames that define usual steps
_NEIGHBOUR_COUNT = 3  # frames on either side of a gap from which it is interpolated


class JointJump(NamedTuple):
    """A joint (its index) that turns by an angle [rad] in the step after a frame, but not in the adjacent steps."""

    frame: int
    joint: int
    angle: float


class Repaired(NamedTuple):
    """A motion without its short gaps.

    Attributes
    ----------
    motion : SourceMotion
        Broken frames are interpolated.
    frames : tuple of int
        Those frames.
    jumps : tuple of int
        Frames after which the whole pose or its place still jumps: because of a leading calibration pose, a longer gap,
        or a cut between two takes.
    shortened : bool
        Whether the last frame is left out.
    joints : tuple of JointJump
        Single joints that jump without return while the rest of the body does not, as when markers are swapped.
    leaps : tuple of int
        Frames after which the body's place leapt while its limbs moved on (`restarted_paths`), which is repaired.
    """

    motion: SourceMotion
    frames: tuple[int, ...]
    jumps: tuple[int, ...]
    shortened: bool
    joints: tuple[JointJump, ...]
    leaps: tuple[int, ...] = ()

    def since(self, first: int) -> "Repaired":
        """Without repairs and jumps before a frame."""
        return self._replace(
            frames=tuple(k for k in self.frames if k >= first),
            jumps=tuple(k for k in self.jumps if k >= first),
            joints=tuple(jump for jump in self.joints if jump.frame >= first),
            leaps=tuple(k for k in self.leaps if k >= first),
        )


def repair_frames(motion: SourceMotion, roles: Roles, rest: int | None = None) -> Repaired:
    """Interpolate short gaps whose neighbours agree with each other but not with the frames between.

    Both jumps of a gap are large compared with the usual steps of a joint, and the step across it is small compared
    with them: no joint turns so far in a frame and back within `MAX_GAP_TIME`. Joints that no segment of the figure
    follows do not count. If the last step of a motion is that large, the last frame is broken and is left out, unless
    it is `rest`, a frame that is stated to show the rest pose.
    """
    if motion.n_frames < MIN_FRAME_COUNT:
        return Repaired(motion, (), (), False, ())
    motion, broken = _without_gaps(motion, roles)
    shortened = rest != motion.n_frames - 1 and any(track.jumps(track.steps[::-1]) for track in _tracks(motion, roles))
    if shortened:
        motion = replace(motion, rotations=motion.rotations[:-1], translations=motion.translations[:-1])
    jumps, joints = _remaining_jumps(motion, roles)
    return Repaired(motion, _indices(broken), jumps, shortened, joints)


def _without_gaps(motion: SourceMotion, roles: Roles) -> tuple[SourceMotion, Mask]:
    """The motion with short gaps interpolated, and the frames (n,) that were."""
    broken, used = np.zeros(motion.n_frames, dtype=bool), used_joints(motion, roles)
    longest = max(1, int(MAX_GAP_TIME * motion.fps))
    lost = motion.at_rest(used)
    for before, last in pairwise(np.flatnonzero(_rest_jumps(lost, joint_steps(motion, roles)))):
        # Programs write zeros for a frame without data.
        broken[before + 1 : last + 1] = lost[before + 1 : last + 1].all() and last - before <= longest
    motion = interpolated(motion, broken)

    # Shorter gaps first: otherwise the good frames between two of them would look like a gap.
    tracks: tuple[_Track, ...] = ()
    for length in range(1, longest + 1):
        tracks = tracks or _tracks(motion, roles)
        found = np.concatenate([track.gaps(length) for track in tracks])
        for k in found:
            broken[k + 1 : k + 1 + length] = True
        if len(found):
            motion, tracks = interpolated(motion, broken), ()
    return motion, broken


def _remaining_jumps(motion: SourceMotion, roles: Roles) -> tuple[tuple[int, ...], tuple[JointJump, ...]]:
    """Frames after which the whole pose or its place jumps, and the jumps of single joints at other times."""
    used, steps = used_joints(motion, roles), joint_steps(motion, roles)
    jumping = (steps > np.maximum(_jump_limits(steps, 2), _MIN_JUMP_ANGLE)).mean(axis=1) >= _MIN_JOINT_FRACTION
    jumping |= _rest_jumps(motion.at_rest(used), steps)
    root = root_positions(motion, roles)[:, 0]
    jumping |= _lasting_jumps(_distances(root[:-1], root[1:]), _MIN_ROOT_JUMP * thigh_length(motion, roles))
    single = np.argwhere(_lasting_jumps(steps, _MIN_JUMP_ANGLE) & ~jumping[:, None])
    return _indices(jumping), tuple(JointJump(int(k), used[i], float(steps[k, i])) for k, i in single)


def first_step_jumps(motion: SourceMotion, roles: Roles) -> bool:
    """Whether the first step of a joint or the root is large compared with its usual steps and with the second.

    Of some 220 captures by other people, only those with a leading calibration pose have such a step.
    """
    return motion.n_frames >= MIN_FRAME_COUNT and any(track.jumps(track.steps) for track in _tracks(motion, roles))


def used_joints(motion: SourceMotion, roles: Roles) -> list[int]:
    """Joints that segments of the figure follow, and their ancestors."""
    return sorted({above for joint in roles.segments.values() for above in ancestry(joint, motion.parents)})


def joint_steps(motion: SourceMotion, roles: Roles) -> Array:
    """How far the used joints turn from each frame to the next [rad], shape (n − 1, joints)."""
    used = used_joints(motion, roles)
    return _angles(motion.rotations[:-1, used], motion.rotations[1:, used])


class _Track:
    """Values of shape (n, joints, …) with their distances from frame to frame.

    Parameters
    ----------
    values : array
        Rotations or positions.
    min_jump : float
        Least jump.
    distance, deviation : callable
        Distance between two values, and of a value from the middle of the previous and the next one.
    """

    def __init__(
        self,
        values: Array,
        min_jump: float,
        distance: Callable[[Array, Array], Array],
        deviation: Callable[[Array], Array],
    ) -> None:
        self.values, self.min_jump, self.distance, self.deviation = values, min_jump, distance, deviation
        self.steps = distance(values[:-1], values[1:])
        self.limits = _jump_limits(self.steps, 2)

    def jumps(self, steps: Array) -> bool:
        """Whether the first of steps is large compared with the usual ones and the next one."""
        return bool(np.any(steps[0] > np.maximum(np.maximum(self.limits, self.min_jump), _MIN_JUMP_RATIO * steps[1])))

    def gaps(self, length: int) -> npt.NDArray[np.intp]:
        """Last good frames before the gaps of a given length."""
        values = self.values
        smaller_jump = np.minimum(self.steps[:-length], self.steps[length:])
        is_gap = smaller_jump > self.limits
        if length == 1:
            deviations = self.deviation(values)
            is_gap |= deviations > _jump_limits(deviations, 3)
        is_gap &= smaller_jump > self.min_jump
        first = np.flatnonzero(is_gap.any(axis=1))
        across = self.distance(values[first], values[first + length + 1])
        gap = (
            is_gap[first]
            & (across < _MAX_GAP_STEP_RATIO * smaller_jump[first])
            & ~self._is_turning_point(first, first + length + 1, smaller_jump[first])
        )
        return first[gap.any(axis=1)]

    def _is_turning_point(self, first: npt.NDArray[np.intp], last: npt.NDArray[np.intp], smaller_jump: Array) -> Mask:
        """Whether the motion returns from `last` the way it came to `first`, as when it is played backwards after that.

        Then the step before is of the usual size and not small compared with the jump, and the values before `first`
        and after `last` agree, too.
        """
        within = (first > 0) & (last < len(self.values) - 1)
        before, after = np.where(within, first - 1, 0), np.where(within, last + 1, 0)
        approach = self.steps[before]
        agrees = self.distance(self.values[before], self.values[after]) < _MAX_RETURN_RATIO * approach
        return within[:, None] & (approach > _MIN_APPROACH_RATIO * smaller_jump) & (approach <= self.limits) & agrees


def _tracks(motion: SourceMotion, roles: Roles) -> tuple[_Track, ...]:
    """Tracks of the joints' rotations and of the root's position."""
    rotations = motion.rotations[:, used_joints(motion, roles)]
    return (_Track(rotations, _MIN_JUMP_ANGLE, _angles, _angle_to_middle),
            _Track(root_positions(motion, roles), _MIN_ROOT_JUMP * thigh_length(motion, roles),
                   _distances, _distance_to_middle))  # fmt: skip


def root_positions(motion: SourceMotion, roles: Roles) -> Array:
    """Position of the pelvis as the file moves it, shape (n, 1, 3), in its unit."""
    return motion.translations[:, ancestry(roles.segments["pelvis"], motion.parents)].sum(axis=1, keepdims=True)


def thigh_length(motion: SourceMotion, roles: Roles) -> float:
    """Length of the left thigh, in the file's unit."""
    return float(np.linalg.norm(np.median(motion.translations[:, roles.segments["left_shank"]], axis=0)))


def _jump_limits(measures: Array, own: int) -> Array:
    """Bounds that measures exceed only in a gap; the `own` largest, which a gap itself causes, do not count."""
    return _MIN_JUMP_RATIO * np.quantile(np.sort(measures, axis=0)[:-own], 0.95, axis=0)


def _rest_jumps(lost: Mask, steps: Array) -> Mask:
    """Which steps (n − 1, joints) are jumps into or out of frames (n,) in the zero pose.

    The zero pose may be one of the motion's own, as where its first frame was made the rest pose: then no joint turns
    much further into it than in the step before, or out of it than in the step after.
    """
    zero = np.zeros_like(steps[:1])
    outside = np.where(lost[1:, None], np.concatenate((zero, steps[:-1])), np.concatenate((steps[1:], zero)))
    return (lost[1:] != lost[:-1]) & (steps > np.maximum(_MIN_JUMP_ANGLE, MAX_STEP_RATIO * outside)).any(axis=1)


def _lasting_jumps(steps: Array, min_step: float) -> Mask:
    """Which steps (n − 1, …) are large compared with the usual ones and with both adjacent ones."""
    zero = np.zeros_like(steps[:1])
    adjacent = np.maximum(np.concatenate((zero, steps[:-1])), np.concatenate((steps[1:], zero)))
    return (steps > min_step) & (steps > _jump_limits(steps, 2)) & (steps > _MIN_JUMP_RATIO * adjacent)


def _indices(chosen: Mask) -> tuple[int, ...]:
    return tuple(int(k) for k in np.flatnonzero(chosen))


def _dot_products(first: Array, second: Array) -> Array:
    return np.einsum("...i,...i", first, second)


def _angles(first: Array, second: Array) -> Array:
    return 2.0 * np.arccos(np.minimum(np.abs(_dot_products(first, second)), 1.0))


def _angle_to_middle(q: Array) -> Array:
    before, after = q[:-2], q[2:]
    middle = before + np.copysign(1.0, _dot_products(before, after))[..., None] * after
    return _angles(q[1:-1], middle / np.linalg.norm(middle, axis=-1, keepdims=True))


def _distances(first: Array, second: Array) -> Array:
    return np.linalg.norm(second - first, axis=-1)


def _distance_to_middle(p: Array) -> Array:
    return _distances(p[1:-1], (p[:-2] + p[2:]) / 2.0)


def interpolated(motion: SourceMotion, broken: Mask) -> SourceMotion:
    """The motion with broken frames (n,) interpolated by cubic splines through the frames beside them."""
    if not broken.any():
        return motion
    rotations, translations = motion.rotations.copy(), motion.translations.copy()
    intact = np.flatnonzero(~broken)
    for frames in np.split(np.flatnonzero(broken), np.flatnonzero(np.diff(np.flatnonzero(broken)) > 1) + 1):
        position = np.searchsorted(intact, frames[0])
        beside = intact[max(0, position - _NEIGHBOUR_COUNT) : position + _NEIGHBOUR_COUNT]
        between = CubicSpline(beside, quaternions.sign_continuous(motion.rotations[beside]))(frames)
        rotations[frames] = between / np.linalg.norm(between, axis=-1, keepdims=True)
        translations[frames] = CubicSpline(beside, motion.translations[beside])(frames)
    return replace(motion, rotations=rotations, translations=translations)
