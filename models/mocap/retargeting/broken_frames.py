"""Repair of frames that a capture has lost: where a joint jumps away and, within a tenth of a second, jumps back.

At the end of a file, where nothing comes back, one frame that jumps away is left out.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from models.arrays import Array, Mask
from models.mocap.motion import quaternions
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.skeleton_roles import Roles, ancestry

_LONGEST = 0.1  # longest gap that is interpolated [s]
# Least ratio of a gap's jumps to the 95th percentile of the joint's steps, and of a single frame's distance from the
# middle of its neighbours to the 95th percentile of such distances. Of the captures of
# docs/validation/prepared-captures.md and the embedded clips, at their own rates and down to 15 Hz, joints that turn
# out and back by `_TURN` have at most 4.9; but for a hand of CMU 16_09, whose markers flip for a frame.
_TIMES = 5.5
# Half or twice of `_LONGEST` or of the next numbers changes none of the 17 captures of the tuning half, but for half of
# `_TURN`, which changes one by 0.3° RMS.
_TURN = np.deg2rad(15.0)  # least jump of a joint [rad]
_WAY = 0.25  # least jump of the root [thigh lengths]
_BACK = 0.3  # largest step across a gap, as a share of the lesser jump
# Least step before a turning point of a motion there and back, as a share of the next, 0.31 to 0.9 in two captures, and
# largest distance between before and after, as a share of it.
_CAME, _ALIKE = 0.3, 0.1
_JOINTS = 0.25  # least share of the joints that jump at once where the whole pose does
FEWEST = 10  # least number of frames that define usual steps
_BESIDE = 3  # frames on either side of a gap through which it is interpolated


class JointJump(NamedTuple):
    """A joint, by its index, that turns by an angle [rad] in the step after a frame, and not in the steps beside."""

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
        Frames after which the whole pose or its place jumps nevertheless: a calibration pose in front, a longer gap, or
        a cut between two takes.
    shortened : bool
        Whether the last frame is left out.
    joints : tuple of JointJump
        Single joints that jump for good while the rest of the body does not, as with markers that are exchanged.
    """

    motion: SourceMotion
    frames: tuple[int, ...]
    jumps: tuple[int, ...]
    shortened: bool
    joints: tuple[JointJump, ...]


def repaired(motion: SourceMotion, roles: Roles, rest: int | None = None) -> Repaired:
    """Interpolate short gaps whose neighbours agree with each other but not with the frames between.

    Both jumps of a gap are large beside the usual steps of a joint, and the step across it is a small part of them: no
    joint turns so far in a frame and back within `_LONGEST`. Joints that no segment of the figure follows do not count.
    The last step of a motion is large beside the usual ones only where the last frame is broken; it stays if it is
    `rest`, a frame that is stated to show the rest pose.
    """
    broken = np.zeros(motion.n_frames, dtype=bool)
    if motion.n_frames < FEWEST:
        return Repaired(motion, (), (), False, ())
    used = used_joints(motion, roles)
    longest = max(1, int(_LONGEST * motion.fps))
    lost, steps = motion.at_rest(used), _angles(motion.rotations[:-1, used], motion.rotations[1:, used]).max(axis=1)
    edges = np.flatnonzero((lost[1:] != lost[:-1]) & (steps > _TURN))
    for before, last in pairwise(edges):
        # Programs write zeros for a frame without data.
        broken[before + 1 : last + 1] = lost[before + 1 : last + 1].all() and last - before <= longest
    motion = _interpolated(motion, broken)

    # Shorter gaps first: between two of them, the frames that are right would look like a gap.
    tracks: tuple[_Track, ...] = ()
    for length in range(1, longest + 1):
        tracks = tracks or _tracks(motion, roles)
        found = np.concatenate([track.gaps(length) for track in tracks])
        for k in found:
            broken[k + 1 : k + 1 + length] = True
        if len(found):
            motion, tracks = _interpolated(motion, broken), ()
    shortened = rest != motion.n_frames - 1 and any(track.ends_off() for track in tracks or _tracks(motion, roles))
    if shortened:
        motion = replace(motion, rotations=motion.rotations[:-1], translations=motion.translations[:-1])
    steps = _angles(motion.rotations[:-1, used], motion.rotations[1:, used])
    left = (steps > np.maximum(_limits(steps, 2), _TURN)).mean(axis=1) >= _JOINTS
    lost = motion.at_rest(used)
    left |= (lost[1:] != lost[:-1]) & (steps.max(axis=1) > _TURN)
    root = _root(motion, roles)[:, 0]
    left |= _cuts(_ways(root[:-1], root[1:]), _WAY * _thigh(motion, roles))
    single = np.argwhere(_cuts(steps, _TURN) & ~left[:, None])
    joints = tuple(JointJump(int(k), used[i], float(steps[k, i])) for k, i in single)
    return Repaired(motion, _indices(broken), _indices(left), shortened, joints)


def begins_off(motion: SourceMotion, roles: Roles) -> bool:
    """Whether a joint or the root leaves the first frame by a step that is large beside its usual ones and the next.

    Of some 220 captures of other people such a step is in those alone that have a calibration pose in front.
    """
    return motion.n_frames >= FEWEST and any(track.begins_off() for track in _tracks(motion, roles))


def used_joints(motion: SourceMotion, roles: Roles) -> list[int]:
    """Joints that segments of the figure follow, and those above them."""
    return sorted({above for joint in roles.segments.values() for above in ancestry(joint, motion.parents)})


class _Track:
    """Values of shape (n, joints, …) with their distances from frame to frame.

    Parameters
    ----------
    values : array
        Rotations or positions.
    least : float
        Least jump.
    apart, off : callable
        Distance of two values, and of a value from the middle of those before and after it.
    """

    def __init__(
        self, values: Array, least: float, apart: Callable[[Array, Array], Array], off: Callable[[Array], Array]
    ) -> None:
        self.values, self.least, self.apart, self.off = values, least, apart, off
        self.steps = apart(values[:-1], values[1:])
        self.limits = _limits(self.steps, 2)

    def ends_off(self) -> bool:
        """Whether the last step is large beside the usual ones and the one before it, which a fast start is not."""
        return self._is_off(self.steps[::-1])

    def begins_off(self) -> bool:
        """Whether the first step is so beside the usual ones and the next."""
        return self._is_off(self.steps)

    def _is_off(self, steps: Array) -> bool:
        return bool(np.any(steps[0] > np.maximum(np.maximum(self.limits, self.least), _TIMES * steps[1])))

    def gaps(self, length: int) -> npt.NDArray[np.intp]:
        """Frames before the gaps of a length."""
        values = self.values
        lesser = np.minimum(self.steps[:-length], self.steps[length:])
        odd = lesser > self.limits
        if length == 1:
            off = self.off(values)
            odd |= off > _limits(off, 3)
        odd &= lesser > self.least
        first = np.flatnonzero(odd.any(axis=1))
        across = self.apart(values[first], values[first + length + 1])
        gap = odd[first] & (across < _BACK * lesser[first]) & ~self._returns(first, first + length + 1, lesser[first])
        return first[gap.any(axis=1)]

    def _returns(self, first: npt.NDArray[np.intp], last: npt.NDArray[np.intp], lesser: Array) -> Mask:
        """Whether the motion goes back from `last` by the way it came to `first`, as when it is played there and back.

        The step before is no small part of the jump then, but as usual, and what is two steps apart agrees, too.
        """
        within = (first > 0) & (last < len(self.values) - 1)
        before, after = np.where(within, first - 1, 0), np.where(within, last + 1, 0)
        came = self.steps[before]
        same = self.apart(self.values[before], self.values[after]) < _ALIKE * came
        return within[:, None] & (came > _CAME * lesser) & (came <= self.limits) & same


def _tracks(motion: SourceMotion, roles: Roles) -> tuple[_Track, ...]:
    """Rotations of the joints, and places of the root."""
    rotations = motion.rotations[:, used_joints(motion, roles)]
    return (_Track(rotations, _TURN, _angles, _turned_off),
            _Track(_root(motion, roles), _WAY * _thigh(motion, roles), _ways, _moved_off))  # fmt: skip


def _root(motion: SourceMotion, roles: Roles) -> Array:
    return motion.translations[:, ancestry(roles.segments["pelvis"], motion.parents)].sum(axis=1, keepdims=True)


def _thigh(motion: SourceMotion, roles: Roles) -> float:
    return float(np.linalg.norm(np.median(motion.translations[:, roles.segments["left_shank"]], axis=0)))


def _limits(measures: Array, own: int) -> Array:
    """What a joint's measures exceed in a gap only; the `own` largest, which a gap itself causes, are not counted."""
    return _TIMES * np.quantile(np.sort(measures, axis=0)[:-own], 0.95, axis=0)


def _cuts(steps: Array, least: float) -> Mask:
    """Which steps (n − 1, …) are large beside the usual ones and beside both that are next to them."""
    still = np.zeros_like(steps[:1])
    beside = np.maximum(np.concatenate((still, steps[:-1])), np.concatenate((steps[1:], still)))
    return (steps > least) & (steps > _limits(steps, 2)) & (steps > _TIMES * beside)


def _indices(chosen: Mask) -> tuple[int, ...]:
    return tuple(int(k) for k in np.flatnonzero(chosen))


def _dots(ours: Array, theirs: Array) -> Array:
    return np.einsum("...i,...i", ours, theirs)


def _angles(ours: Array, theirs: Array) -> Array:
    return 2.0 * np.arccos(np.minimum(np.abs(_dots(ours, theirs)), 1.0))


def _turned_off(q: Array) -> Array:
    before, after = q[:-2], q[2:]
    middle = before + np.copysign(1.0, _dots(before, after))[..., None] * after
    return _angles(q[1:-1], middle / np.linalg.norm(middle, axis=-1, keepdims=True))


def _ways(ours: Array, theirs: Array) -> Array:
    return np.linalg.norm(theirs - ours, axis=-1)


def _moved_off(p: Array) -> Array:
    return _ways(p[1:-1], (p[:-2] + p[2:]) / 2.0)


def _interpolated(motion: SourceMotion, broken: Mask) -> SourceMotion:
    """The motion with its broken frames on cubic splines through the frames beside them."""
    if not broken.any():
        return motion
    rotations, translations = motion.rotations.copy(), motion.translations.copy()
    good = np.flatnonzero(~broken)
    for frames in np.split(np.flatnonzero(broken), np.flatnonzero(np.diff(np.flatnonzero(broken)) > 1) + 1):
        at = np.searchsorted(good, frames[0])
        beside = good[max(0, at - _BESIDE) : at + _BESIDE]
        between = CubicSpline(beside, quaternions.sign_continuous(motion.rotations[beside]))(frames)
        rotations[frames] = between / np.linalg.norm(between, axis=-1, keepdims=True)
        translations[frames] = CubicSpline(beside, motion.translations[beside])(frames)
    return replace(motion, rotations=rotations, translations=translations)
