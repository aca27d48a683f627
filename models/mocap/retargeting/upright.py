r"""Estimation of a file's vertical axis from the motion, with its lead over the next.

Each of the file's six axes u is scored: the body should stand along u, not climb along u, and have its weight over its
lowest joints,

.. math:: s(u) = \overline{\hat b \cdot u} - \sigma(\min_j p_j \cdot u)/l - 2\,\overline{d(u)}/l + \beta(u)

with b from the feet to the trunk's upper end; σ the spread (5 to 95 %) of the lowest joint's height; d the distance of
the middle of hips and shoulders outside the hull of the joints nearest to the floor, seen along u; l the length of the
legs; and β = 0.1 for +Y and +Z, the only axes that programs write. The criteria hold only while the body is supported,
so only frames count in which a joint is at rest or, if those are few, the calmest ones. A somersault is judged by its
stances.

Conventions of programs are further evidence: in most files the floor is at zero, and rigs stand along the vertical in
their zero pose. A body that lies throughout fits an axis in the floor as well as a standing body fits the vertical; it
is refused if it is flat on the plane zero of +Y or +Z along which its rig stands. Runs on curves, whose weight is
beside their feet, need a lower score if both conventions confirm it. A body that stands along an axis far ahead of all
others needs no least score: it climbs over boxes or stairs. If the best axis is not the one along which the rig is
drawn, it has to lead by more, and by far if the body turns towards that axis at times: a falling body is calm only
while it lies. A body that sits, with trunk and shanks along the axis of its rig and thighs across, is upright although
its weight is beside its feet; if the rig is drawn along neither +Y nor +Z and the score is not clear, along one of
these whose floor is at zero. Any other axis has to be that of the zero pose, or have its floor at zero, as nothing else
tells a body that stands along it from a swimmer's.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from geometry.arrays import Array, IntArray, Mask
from geometry.quaternions import unit
from geometry.spans import spans
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.body_lines import AT_REST, BodyLines, body_lines
from models.mocap.retargeting.skeleton_roles import Roles

AXES = {"+X": (1, 0, 0), "-X": (-1, 0, 0), "+Y": (0, 1, 0), "-Y": (0, -1, 0), "+Z": (0, 0, 1), "-Z": (0, 0, -1)}
# Half or twice β, or any of the values below except the least scores, finds the same axes for 17 captures.
_CONVENTION_BONUS = 0.1  # β
_WRITTEN_AXES = ("+Y", "+Z")  # the only verticals that programs write
# Least lead of the best axis over the next: the 28 captures of docs/validation/prepared-captures.md have 0.72 and more.
_MIN_LEAD = 0.25
# Least score of the best axis for bodies that rest on the ground, and for bodies that hardly do. In the same captures
# it is 0.2 and more, even for cartwheels, and 0.59 and more for runs; wrong axes of pieces of half a second have at
# most 0.1 and 0.37.
_MIN_RESTING_SCORE, _MIN_MOVING_SCORE = 0.15, 0.45
# Mean cosine of b to the best axis, and its lead, from which it needs no least score: a body that crawls or swims along
# an axis leads over the vertical by at most 0.1. In 891 windows of 0.5 to 20 s of 120 captures, no wrong axis with less
# than its least score had both: the nearest had 0.87 and 1.1.
_MIN_STANDING_COSINE, _MIN_STANDING_LEAD = 0.9, 1.0
# Cosine of both trunk and b, at some time, to the axis along which the rig is drawn, and that axis's lead, from which
# it needs no least score: in 3271 windows of 0.5 to 20 s of 180 captures this finds 41 more axes, and no wrong one.
_MIN_DRAWN_COSINE, _MIN_DRAWN_LEAD = 0.95, 0.5
# Least lead of an axis along which the rig is not drawn: the first value, or the second if the cosine of trunk or b to
# the rig's axis exceeds the third at some time; no lead suffices if the body stands as drawn at some time. Of 53 wrong
# axes in 4878 such windows (falls, jumps and climbs), those with a larger cosine lead by at most 0.96, the others by
# 0.67; two whole captures whose rigs are drawn along another axis lead by 0.72 and 1.55.
_MIN_OTHER_LEAD, _MIN_TURNED_LEAD, _TURNED_COSINE = 0.7, 1.2, 0.5
# Least mean cosine of trunk and shanks of a sitting body to the vertical, and largest one of its thighs: 0.9 and more,
# and 0.06 to 0.59, in 23 captures of people on chairs and a bicycle.
_MIN_SITTING_COSINE, _MAX_THIGH_COSINE = 0.85, 0.7
# Distance of the body's middle outside its lowest joints [leg lengths] and time [s] beyond which something that is not
# in the file supports it: in 200 captures, this finds people on chairs and cliffs, and five others.
_MIN_PROPPED_DISTANCE, _MIN_PROPPED_TIME = 0.25, 1.0
_MAX_CLIMB = 10.0  # height of the highest capture volumes [leg lengths]: a larger climb means a root in another unit
_CALM_FRACTION = 0.4  # least fraction of the frames that are judged
# Height above the lowest joint up to which joints may bear load [leg lengths]: ankles above toes.
_MAX_SUPPORT_HEIGHT = 0.12
# Largest height of the lowest joint above a floor at zero for a lying body, and for a running one, whose lowest joint
# may be an ankle [leg lengths]: 0.02 and 0.04 in two captures, and 0.01 to 0.19 in eight runs with low scores.
_MAX_LYING_OFFSET, _MAX_RUNNING_OFFSET = 0.1, 0.2
# Largest distance of the lowest joint from a floor at zero, for an axis that programs do not write and for a seat
# [leg lengths]: at most 0.04 in three files, and 1.2 of a swimmer; of 782 files no other's axis depends on it.
_MAX_FLOOR_OFFSET = 0.3
_MIN_ALONG_COSINE = 0.8  # least cosine of the zero pose, and of the trunk of a run, to the vertical
_MAX_LYING_HEIGHT = 0.5  # largest height of a lying body [leg lengths]: 0.2 and 0.3 in two captures
_SAMPLE_COUNT = 200  # number of frames that are evaluated
_DIRECTION_COUNT = 16  # directions in which the hull of the bearing joints is bounded


class Up(NamedTuple):
    """The vertical of a file.

    Attributes
    ----------
    axis : array of shape (3,)
        Upward unit vector in the file's axes.
    lead : float
        Lead of its score over that of the next axis; infinite where the format or the user states it.
    """

    axis: Array
    lead: float


def up_axis(motion: SourceMotion, roles: Roles, lines: BodyLines, positions: Array, said: str | None = None) -> Up:
    """The file's axis that points up: as the user or the format states it, or estimated from joint positions (n, m, 3).

    Raises
    ------
    MotionFileError
        If the estimate is not clear.
    """
    if (name := said or motion.up) is not None:
        return Up(np.array(AXES[name], dtype=np.float64), np.inf)
    # Lost frames are in the zero pose, which need not be upright.
    lost = motion.at_rest(range(len(motion.joints)))[-len(positions) :]
    calm, at_rest = _calm_frames(positions / lines.leg, motion.fps, lost)
    frames = calm[np.unique(np.linspace(0, len(calm) - 1, _SAMPLE_COUNT).round().astype(int))]
    scores = {name: _axis_score(name, lines, positions, frames) for name in AXES}
    best, second = sorted(scores, key=lambda name: -scores[name])[:2]
    lead = scores[best] - scores[second]
    rig = _describe_rig(_zero_pose_direction(motion, roles), lines, ~lost)
    if (lying := _lying_axis(best, rig.zero, positions[frames] / lines.leg)) is not None:
        lead, best, second = 0.0, lying, best
    min_score = _min_score(best, lead, at_rest, rig, lines, positions, frames)
    clear = lead >= _MIN_LEAD and scores[best] >= min_score
    floors = {name: _has_floor_at_zero(name, lines, positions[frames]) for name in AXES}
    if not (best in _WRITTEN_AXES or rig.zero @ AXES[best] > _MIN_ALONG_COSINE or floors[best]):
        clear, second = False, max(_WRITTEN_AXES, key=lambda name: scores[name])
    seat = next((name for name in _WRITTEN_AXES if _is_sitting(lines, frames, np.array(AXES[name]))), None)
    if seat is not None and (seat == rig.drawn or (rig.drawn is None and floors[seat] and not clear)):
        clear, best, lead = True, seat, max(lead, _MIN_LEAD)
    elif rig.contradicts(best, lead):
        clear, second = False, str(rig.drawn)
    # Without ankles, the lowest joints are knees, which do not support a squat.
    if not clear or np.isnan(lines.ankles).any():
        raise MotionFileError(
            motion.path, 0, f"the up axis cannot be inferred ({best} or {second})", f"--up {best} or --up {second}"
        )
    return Up(np.array(AXES[best], dtype=np.float64), lead)


class _Rig(NamedTuple):
    """Orientation of a rig in its zero pose.

    Attributes
    ----------
    zero : array of shape (3,)
        Direction from the feet to the trunk's upper end with all rotations zero; 0 if it is undefined.
    drawn : str or None
        The axis, +Y or +Z, along which this direction is.
    turned : float
        Largest cosine of trunk or body to this axis in any frame; −1 without such an axis.
    stands : bool
        Whether both are along it at some time.
    """

    zero: Array
    drawn: str | None
    turned: float
    stands: bool

    def contradicts(self, best: str, lead: float) -> bool:
        """Whether the rig is drawn along another axis than the best one, whose lead is too small to overrule this."""
        min_lead = np.inf if self.stands else _MIN_TURNED_LEAD if self.turned > _TURNED_COSINE else _MIN_OTHER_LEAD
        return self.drawn not in (best, None) and lead < min_lead


def _describe_rig(zero: Array, lines: BodyLines, kept: Mask) -> _Rig:
    """The rig's axis, and how the body is oriented to it in the frames `kept`."""
    drawn = next((name for name in _WRITTEN_AXES if zero @ AXES[name] > _MIN_ALONG_COSINE), None)
    if drawn is None or not kept.any():
        return _Rig(zero, drawn, -1.0, False)
    largest = [float((part[kept] @ AXES[drawn]).max()) for part in (_body_directions(lines), unit(lines.trunk))]
    return _Rig(zero, drawn, max(largest), min(largest) > _MIN_DRAWN_COSINE)


def _min_score(
    best: str, lead: float, at_rest: bool, rig: _Rig, lines: BodyLines, positions: Array, frames: IntArray
) -> float:
    """Score that the best axis needs; −inf if its lead alone suffices."""
    lowest = (positions[frames] @ AXES[best]).min(axis=1) / lines.leg
    stands_out = (
        float((_body_directions(lines)[frames] @ AXES[best]).mean()) > _MIN_STANDING_COSINE
        and lead > _MIN_STANDING_LEAD
    )
    stands_as_drawn = rig.drawn == best and rig.stands and lead > _MIN_DRAWN_LEAD
    if (stands_out or stands_as_drawn) and np.ptp(lowest) < _MAX_CLIMB:
        return -np.inf
    along = min(rig.zero @ AXES[best], unit(lines.trunk)[frames].mean(axis=0) @ AXES[best]) > _MIN_ALONG_COSINE
    confirmed = along and np.median(np.abs(lowest)) < _MAX_RUNNING_OFFSET
    return _MIN_RESTING_SCORE if at_rest or confirmed else _MIN_MOVING_SCORE


def _has_floor_at_zero(name: str, lines: BodyLines, positions: Array) -> bool:
    """Whether the lowest joint is near zero along an axis, half of the time."""
    lowest = (positions @ AXES[name]).min(axis=1) / lines.leg
    return float(np.median(np.abs(lowest))) < _MAX_FLOOR_OFFSET


def _is_sitting(lines: BodyLines, frames: IntArray, up: Array) -> bool:
    """Whether trunk and shanks are along an axis, and thighs across it."""
    thighs, shanks = lines.hips - lines.knees, lines.knees - lines.ankles
    trunk, thigh, shank = (
        float((unit(part)[frames] @ up).mean()) for part in (lines.trunk, thighs.mean(axis=1), shanks.mean(axis=1))
    )
    return min(trunk, shank) > _MIN_SITTING_COSINE and thigh < _MAX_THIGH_COSINE


def _lying_axis(best: str, zero: Array, positions: Array) -> str | None:
    """The vertical (+Y or +Z) if, contrary to the best axis, the body lies on a floor; positions in leg lengths."""
    heights = {name: positions @ np.array(AXES[name], dtype=np.float64) for name in (best, *_WRITTEN_AXES)}
    offsets = {name: float(np.quantile(np.abs(h.min(axis=1)), 0.9)) for name, h in heights.items()}
    for name in _WRITTEN_AXES:
        is_low = float(np.median(np.ptp(heights[name], axis=1))) < _MAX_LYING_HEIGHT
        if offsets[name] < min(_MAX_LYING_OFFSET, offsets[best]) and is_low and zero @ AXES[name] > _MIN_ALONG_COSINE:
            return name
    return None


def _zero_pose_direction(motion: SourceMotion, roles: Roles) -> Array:
    """Direction from the feet to the trunk's upper end with all rotations zero; 0 if it is undefined."""
    unturned = np.zeros((1, len(motion.joints), 4))
    unturned[..., 0] = 1.0
    zero = replace(motion, rotations=unturned, translations=np.median(motion.translations, axis=0, keepdims=True))
    try:
        lines = body_lines(zero, roles, zero.global_positions(unturned), unturned)
    except MotionFileError:
        return np.zeros(3)
    return np.nan_to_num(_body_directions(lines)[0])


def _body_directions(lines: BodyLines) -> Array:
    """Unit vectors b from the feet to the trunk's upper end, shape (n, 3)."""
    return unit(lines.top - lines.lowest_joints.mean(axis=1))


def _calm_frames(positions: Array, fps: float, lost: Mask) -> tuple[IntArray, bool]:
    """Frames in which a joint is at rest, or else the calmest (`_CALM_FRACTION`); and whether joints are at rest."""
    if len(positions) == 1 or lost.all():
        return np.arange(len(positions)), True
    slowest = np.linalg.norm(np.gradient(positions, axis=0), axis=2).min(axis=1) * fps
    calm = float(np.quantile(slowest[~lost], _CALM_FRACTION))
    return np.flatnonzero((slowest <= max(AT_REST, calm)) & ~lost), calm <= AT_REST


def _axis_score(name: str, lines: BodyLines, positions: Array, frames: IntArray) -> float:
    up = np.array(AXES[name], dtype=np.float64)
    body = _body_directions(lines)[frames]
    heights = positions[frames] @ up
    lowest = heights.min(axis=1)
    spread = float(np.subtract(*np.quantile(lowest, (0.95, 0.05)))) / lines.leg
    balance = float(_outside(lines, positions, frames, up)[0].mean()) / lines.leg
    return float((body @ up).mean()) - min(spread, 1.0) - 2.0 * balance + _CONVENTION_BONUS * (name in _WRITTEN_AXES)


def _outside(lines: BodyLines, positions: Array, frames: IntArray, up: Array) -> tuple[Array, Array]:
    """Distance of the middle of hips and shoulders outside the hull of the lowest joints, seen along an axis, (m,).

    The second array has the horizontal unit vectors from the hull to the middle, (m, 3); 0 inside.
    """
    heights = positions[frames] @ up
    bearing = heights < heights.min(axis=1)[:, None] + _MAX_SUPPORT_HEIGHT * lines.leg
    first, second = np.roll(up, 1), np.roll(up, 2)
    middle = (lines.middle + lines.top)[frames] / 2.0
    outside, directions = np.zeros(len(frames)), np.zeros((len(frames), 3))
    for angle in np.arange(_DIRECTION_COUNT) * 2.0 * np.pi / _DIRECTION_COUNT:
        along = np.cos(angle) * first + np.sin(angle) * second
        furthest = np.where(bearing, positions[frames] @ along, -np.inf).max(axis=1)
        distance = middle @ along - furthest
        directions[distance > outside] = along
        outside = np.maximum(outside, distance)
    return outside, directions


def unsupported_time(lines: BodyLines, positions: Array, up: Array, fps: float, gravity: float) -> float:
    r"""Time for which neither the feet nor other low parts hold the body [s]: on a chair, against a wall, on a rope.

    Its weight is beside them for a second or more, and its acceleration a does not explain that. Forces on the lowest
    joints, from which the body's middle is d away horizontally and h in height, act without a moment about it if

    .. math:: (g + a_z)\, d = h\, a_h

    (the zero moment point of a point mass). This is tested on average over each second: a run on a curve leans.

    Parameters
    ----------
    lines : BodyLines
        The body in n frames.
    positions : Array
        Its joints, shape (n, joints, 3).
    up : Array
        Upward unit vector, one of the file's axes.
    fps : float
        Frame rate [1/s].
    gravity : float
        g in the file's unit of length [1/s²].
    """
    distances, directions = _outside(lines, positions, np.arange(len(positions)), up)
    middle, lowest = (lines.middle + lines.top) / 2.0, (positions @ up).min(axis=1)
    limit, least, total = _MIN_PROPPED_DISTANCE * lines.leg, _MIN_PROPPED_TIME * fps, 0
    for start, end in spans(distances > limit):
        count = max(1, int((end - start) / max(least, 3.0))) if end - start > least else 0
        for piece in np.array_split(np.arange(start, end), count) if count else []:
            offset = (distances[piece, None] * directions[piece]).mean(axis=0)
            acceleration = _acceleration(middle[piece], fps)
            rise, height = acceleration @ up, float((middle[piece] @ up - lowest[piece]).mean())
            moment = (gravity + rise) * offset - height * (acceleration - rise * up)
            total += len(piece) if float(np.linalg.norm(moment)) > gravity * limit else 0
    return total / fps


def _acceleration(places: Array, fps: float) -> Array:
    """Constant acceleration that fits a path (n, 3) best; 0 of one or two places, which show none."""
    return 2.0 * np.polyfit(np.arange(len(places)) / fps, places, 2)[0] if len(places) > 2 else np.zeros(3)
