r"""Estimation of a file's vertical axis from the motion, with a confidence, and a check for mirrored bodies.

Each of the file's six axes u is scored: the body should stand along u, not climb along u, and have its weight over its
lowest joints,

.. math:: s(u) = \overline{\hat b \cdot u} - \sigma(\min_j p_j \cdot u)/l - 2\,\overline{d(u)}/l + \beta(u)

with b from the feet to the trunk's upper end; σ the spread (5 to 95 %) of the lowest joint's height; d the distance of
the middle of hips and shoulders outside the hull of the joints nearest to the floor, seen along u; l the length of the
legs; and β = 0.1 for +Y and +Z, the only axes that programs write. Only what stands on something has to do so: frames
count in which a joint is at rest, or, if those are few, the calmest ones. A somersault is judged by its stances.

What programs write by custom is evidence besides: in most files floors are at zero, and rigs stand along the vertical
in their zero pose. A body that lies throughout stands along an axis of the floor as well as one that stands, and is
refused where it is flat on the plane zero of +Y or +Z, along which its rig stands. Runs whose curves leave their weight
beside their feet need a lower score where both confirm it. A body that stands along an axis of which all others are far
behind needs no least score: it climbs over boxes or stairs. Where the best axis is not the one along which the rig is
drawn, it has to lead by more, and by far if the body turns towards that at times: what falls is calm only where it
lies. A body that sits, trunk and shanks along the axis of its rig and thighs across, is upright, though its weight is
beside its feet.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from models.arrays import Array, IntArray, Mask
from models.mocap.motion.spans import spans
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.body_lines import AT_REST, BodyLines, body_lines, unit
from models.mocap.retargeting.skeleton_roles import Roles

AXES = {"+X": (1, 0, 0), "-X": (-1, 0, 0), "+Y": (0, 1, 0), "-Y": (0, -1, 0), "+Z": (0, 0, 1), "-Z": (0, 0, -1)}
# Half or twice of β, or of any of the numbers below but the least scores, finds the same axes for 17 captures.
_CUSTOM = 0.1  # β
# Least lead of the best axis over the next: the 28 captures of docs/validation/prepared-captures.md have 0.72 and more.
_CERTAIN = 0.25
# Least score of the best axis where bodies rest on the ground, and where they hardly do. In the same captures it is
# 0.2 and more, even of cartwheels, and 0.59 and more of runs; wrong axes of pieces of half a second have 0.1 and less,
# and 0.37 and less.
_LEAST_RESTING, _LEAST_MOVING = 0.15, 0.45
# Mean cosine of b to the best axis, and its lead, from which it needs no least score: a body that crawls or swims along
# an axis leads over the vertical by 0.1 at most. Of 891 windows of 0.5 to 20 s of 120 captures, no wrong axis that had
# less than its least score had both: the nearest had 0.87 and 1.1.
_STANDING, _ALONE = 0.9, 1.0
# Cosine of trunk and b in some frame to the axis along which the rig is drawn, and its lead, from which that needs no
# least score: in 3271 windows of 0.5 to 20 s of 180 captures this finds 41 more axes, and no wrong one.
_AS_DRAWN, _LEADS = 0.95, 0.5
# Least lead of an axis along which the rig is not drawn, and cosine of trunk or b to that of the rig in some frame
# from which it needs the second; none suffices where the body stands as drawn at times. Of 53 wrong axes of 4878 such
# windows, of falls, jumps and climbs, those with a larger cosine lead by 0.96 at most, the others by 0.67; two whole
# captures whose rigs are drawn otherwise by 0.72 and 1.55.
_AHEAD, _FAR_AHEAD, _TURNED = 0.7, 1.2, 0.5
# Mean cosine of trunk and shanks of a body that sits to the vertical, and largest one of its thighs: 0.9 and more, and
# 0.06 to 0.59, in 23 captures of people on chairs and a bicycle.
_SITS, _ACROSS = 0.85, 0.7
# Distance of the body's middle outside its lowest joints [leg lengths] beyond which something that is not in the file
# bears it, and for longer than what [s]: of 200 captures, people on chairs and cliffs, and five others.
_BESIDE, _STAYS = 0.25, 1.0
_VOLUME = 10.0  # height of the highest capture volumes [leg lengths]: what climbs more has its root in another unit
_CALM = 0.4  # least share of the frames that are judged
_BEARING = 0.12  # height over the lowest joint up to which joints may bear load [leg lengths], as ankles over toes
# Largest height of the lowest joint of a body that lies on a floor at zero, and of one that runs there, whose lowest
# joint may be an ankle [leg lengths]: 0.02 and 0.04 in two captures, and 0.01 to 0.19 in eight runs of low scores.
_ON_ZERO, _OVER_ZERO = 0.1, 0.2
_ALONG = 0.8  # least cosine of the zero pose, and of the trunk of a run, to the vertical
_FLAT = 0.5  # largest height of a body that lies [leg lengths]: 0.2 and 0.3 in two captures
_SAMPLES = 200  # number of frames that are evaluated
_DIRECTIONS = 16  # directions in which the hull of the bearing joints is bounded
# Length of an animal's trunk [leg lengths], 1.0 in two elephants and 1.2 to 1.4 in 12 dogs, and the largest mean cosine
# of one that is across the legs to them: 0.16 in these, and 0.84 and more in ten humans of another make, of 0.7 to 1.3.
_LONG, _LEVEL = 0.8, 0.5
_SURE = 0.15  # least mean sine of the knees' bend, and cosine of the toes' direction, that tell left from right


class Up(NamedTuple):
    """The vertical of a file.

    Attributes
    ----------
    axis : array of shape (3,)
        Upward unit vector in the file's axes.
    confidence : float
        Lead of its score over that of the next axis; infinite where the format or the user states it.
    """

    axis: Array
    confidence: float


def up_axis(motion: SourceMotion, roles: Roles, lines: BodyLines, positions: Array, said: str | None = None) -> Up:
    """The file's axis that points up: as the user or the format states it, or estimated from joint positions (n, m, 3).

    Raises
    ------
    MotionFileError
        If the estimate is not clear.
    """
    if (name := said or motion.up) is not None:
        return Up(np.array(AXES[name], dtype=np.float64), np.inf)
    # Frames that were lost stand in the zero pose, which need not be upright.
    lost = motion.at_rest(range(len(motion.joints)))[-len(positions) :]
    calm, rests = _calm(positions / lines.leg, motion.fps, lost)
    frames = calm[np.unique(np.linspace(0, len(calm) - 1, _SAMPLES).round().astype(int))]
    scores = {name: _score(name, lines, positions, frames) for name in AXES}
    best, second = sorted(scores, key=lambda name: -scores[name])[:2]
    lead = scores[best] - scores[second]
    rig = _rig(_zero_pose(motion, roles), lines, ~lost)
    if (lying := _lies_along(best, rig.zero, positions[frames] / lines.leg)) is not None:
        lead, best, second = 0.0, lying, best
    least = _least_score(best, lead, rests, rig, lines, positions, frames)
    if rig.drawn is not None and _sits(lines, frames, np.array(AXES[rig.drawn])):
        best, lead, least = rig.drawn, max(lead, _CERTAIN), -np.inf
    elif rig.contradicts(best, lead):
        least, second = np.inf, str(rig.drawn)
    if np.isnan(lines.ankles).any():
        least = np.inf  # knees of a squat are no support
    if lead < _CERTAIN or scores[best] < least:
        raise MotionFileError(
            motion.path, 0, f"the motion does not tell what is up ({best} or {second})", f"--up {best} or --up {second}"
        )
    return Up(np.array(AXES[best], dtype=np.float64), lead)


class _Rig(NamedTuple):
    """How a rig is drawn.

    Attributes
    ----------
    zero : array of shape (3,)
        Direction from the feet to the trunk's upper end with all rotations zero; 0 where there is none.
    drawn : str or None
        The axis of +Y and +Z along which that is.
    turned : float
        Largest cosine of trunk or body to it in any frame; −1 without such an axis.
    stands : bool
        Whether both are along it at times.
    """

    zero: Array
    drawn: str | None
    turned: float
    stands: bool

    def contradicts(self, best: str, lead: float) -> bool:
        """Whether the rig is drawn along another axis than the best one, which does not lead by far enough for that."""
        least = np.inf if self.stands else _FAR_AHEAD if self.turned > _TURNED else _AHEAD
        return self.drawn not in (best, None) and lead < least


def _rig(zero: Array, lines: BodyLines, kept: Mask) -> _Rig:
    """How the rig is drawn, and how the body turns towards that in the frames that are kept."""
    drawn = next((name for name in ("+Y", "+Z") if zero @ AXES[name] > _ALONG), None)
    if drawn is None or not kept.any():
        return _Rig(zero, drawn, -1.0, False)
    most = [float((part[kept] @ AXES[drawn]).max()) for part in (_standing(lines), unit(lines.trunk))]
    return _Rig(zero, drawn, max(most), min(most) > _AS_DRAWN)


def _least_score(
    best: str, lead: float, rests: bool, rig: _Rig, lines: BodyLines, positions: Array, frames: IntArray
) -> float:
    """Score that the best axis needs; −inf if it stands out by its lead alone."""
    lowest = (positions[frames] @ AXES[best]).min(axis=1) / lines.leg
    alone = float((_standing(lines)[frames] @ AXES[best]).mean()) > _STANDING and lead > _ALONE
    as_drawn = rig.drawn == best and rig.stands and lead > _LEADS
    if (alone or as_drawn) and np.ptp(lowest) < _VOLUME:
        return -np.inf
    along = min(rig.zero @ AXES[best], unit(lines.trunk)[frames].mean(axis=0) @ AXES[best]) > _ALONG
    confirmed = along and np.median(np.abs(lowest)) < _OVER_ZERO
    return _LEAST_RESTING if rests or confirmed else _LEAST_MOVING


def _sits(lines: BodyLines, frames: IntArray, up: Array) -> bool:
    """Whether trunk and shanks are along an axis, and thighs across it."""
    thighs, shanks = lines.hips - lines.knees, lines.knees - lines.ankles
    trunk, thigh, shank = (
        float((unit(part)[frames] @ up).mean()) for part in (lines.trunk, thighs.mean(axis=1), shanks.mean(axis=1))
    )
    return min(trunk, shank) > _SITS and thigh < _ACROSS


def _lies_along(best: str, zero: Array, positions: Array) -> str | None:
    """Another axis than the best along which a body lies on the floor [leg lengths], if there is one."""
    heights = {name: positions @ np.array(AXES[name], dtype=np.float64) for name in (best, "+Y", "+Z")}
    off = {name: float(np.quantile(np.abs(h.min(axis=1)), 0.9)) for name, h in heights.items()}
    for name in ("+Y", "+Z"):
        flat = float(np.median(np.ptp(heights[name], axis=1))) < _FLAT
        if off[name] < min(_ON_ZERO, off[best]) and flat and zero @ AXES[name] > _ALONG:
            return name
    return None


def _zero_pose(motion: SourceMotion, roles: Roles) -> Array:
    """Direction from the feet to the trunk's upper end with all rotations zero; 0 where there is none."""
    unturned = np.zeros((1, len(motion.joints), 4))
    unturned[..., 0] = 1.0
    zero = replace(motion, rotations=unturned, translations=np.median(motion.translations, axis=0, keepdims=True))
    try:
        lines = body_lines(zero, roles, zero.global_positions(unturned), unturned)
    except MotionFileError:
        return np.zeros(3)
    return np.nan_to_num(_standing(lines)[0])


def _standing(lines: BodyLines) -> Array:
    """Unit vectors b from the feet to the trunk's upper end, shape (n, 3)."""
    return unit(lines.top - lines.lowest_joints.mean(axis=1))


def _calm(positions: Array, fps: float, lost: Mask) -> tuple[IntArray, bool]:
    """Frames in which a joint is at rest, or the `_CALM` share in which the slowest is slowest; whether it is rest."""
    if len(positions) == 1 or lost.all():
        return np.arange(len(positions)), True
    slowest = np.linalg.norm(np.gradient(positions, axis=0), axis=2).min(axis=1) * fps
    calm = float(np.quantile(slowest[~lost], _CALM))
    return np.flatnonzero((slowest <= max(AT_REST, calm)) & ~lost), calm <= AT_REST


def _score(name: str, lines: BodyLines, positions: Array, frames: IntArray) -> float:
    up = np.array(AXES[name], dtype=np.float64)
    body = _standing(lines)[frames]
    heights = positions[frames] @ up
    lowest = heights.min(axis=1)
    spread = float(np.subtract(*np.quantile(lowest, (0.95, 0.05)))) / lines.leg
    balance = float(_outside(lines, positions, frames, up).mean()) / lines.leg
    return float((body @ up).mean()) - min(spread, 1.0) - 2.0 * balance + _CUSTOM * (name in ("+Y", "+Z"))


def _outside(lines: BodyLines, positions: Array, frames: IntArray, up: Array) -> Array:
    """Distance of the middle of hips and shoulders outside the hull of the lowest joints, seen along an axis, (m,)."""
    heights = positions[frames] @ up
    bearing = heights < heights.min(axis=1)[:, None] + _BEARING * lines.leg
    first, second = np.roll(up, 1), np.roll(up, 2)
    middle = (lines.middle + lines.top)[frames] / 2.0
    outside = np.zeros(len(frames))
    for angle in np.arange(_DIRECTIONS) * 2.0 * np.pi / _DIRECTIONS:
        along = np.cos(angle) * first + np.sin(angle) * second
        furthest = np.where(bearing, positions[frames] @ along, -np.inf).max(axis=1)
        outside = np.maximum(outside, middle @ along - furthest)
    return outside


def propped_seconds(lines: BodyLines, positions: Array, up: Array, fps: float) -> float:
    """Time for which the body stays with its weight beside all that is low: on a chair, against a wall, on a rope [s].

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
    """
    beside = _outside(lines, positions, np.arange(len(positions)), up) > _BESIDE * lines.leg
    return sum(end - start for start, end in spans(beside) if end - start > _STAYS * fps) / fps


def check_stature(motion: SourceMotion, lines: BodyLines) -> None:
    """Refuse an animal under the names of a human: a trunk about as long as the legs, and across them throughout.

    Raises
    ------
    MotionFileError
        If it is one.
    """
    size = float(np.median(np.linalg.norm(lines.trunk, axis=1))) / lines.leg
    whole = lines.has_arms and not np.isnan(lines.ankles).any()
    legs = unit((lines.hips - lines.ankles).mean(axis=1))
    if whole and size > _LONG and float(np.sum(unit(lines.trunk) * legs, axis=1).mean()) < _LEVEL:
        what = f"the trunk is {size:.1f} times as long as thigh and shank, and across the legs"
        raise MotionFileError(motion.path, 0, what, "a human, who stands at times")


def check_sides(motion: SourceMotion, lines: BodyLines) -> None:
    """Refuse a mirrored body: hips and trunk define left, which toes, the bend of the knees and the arms must confirm.

    Raises
    ------
    MotionFileError
        If toes and knees show a mirrored body, one of them does while the other is unclear or contradicts it, or the
        shoulders lie on average the other way than the hips: no trunk is twisted by more than 90° throughout.
    """
    left = unit(lines.left)
    # Ahead of its own shank: the toes of a body that kneels point back in the room.
    ahead = unit(np.cross(left[:, None], unit(lines.knees - lines.ankles)))
    toes = np.sum(unit(lines.toes - lines.ankles) * ahead, axis=2)
    knees = lines.knee_normals() @ left[:, :, None]
    signs = [float(np.nanmean(v)) if np.isfinite(v).any() else 0.0 for v in (toes, knees)]
    clear = [np.sign(s) for s in signs if abs(s) > _SURE]
    stated = "left and right as the names say, or --roles FILE that says them"
    shoulders = lines.shoulders[:, 0] - lines.shoulders[:, 1]
    if lines.has_arms and np.sum(lines.left * shoulders) < 0.0:
        which = "legs" if sum(clear) < 0 else "arms" if sum(clear) > 0 else "arms or legs"
        what = f"left and right of the {which} are exchanged: shoulders and hips point opposite ways"
        raise MotionFileError(motion.path, 0, what, stated)
    if clear and sum(clear) < 0:
        back = " and ".join(part for part, sign in zip(("toes", "knees"), signs, strict=True) if sign < -_SURE)
        raise MotionFileError(motion.path, 0, f"the body is mirrored: {back} point back", stated)
    if clear and sum(clear) == 0:
        raise MotionFileError(
            motion.path, 0, "toes and knees point opposite ways", "a body that bends its knees forwards"
        )
